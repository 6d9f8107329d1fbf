"""`./run bench parts`: latency and error of poses from parts of a revolution (`scan_fraction`), on simulated recordings.

Latency counts from the oldest point that went in to the moment the pose is there. It is the time between
first and last point, and the mean time of the work. Error: RMS distance from the truth after the path of
the scans was laid on it by yaw and translation. The truth has a pose and a velocity for each scan;
between them it is the cubic of both. Python standard library only."""

import argparse
import bisect
import math
import sys
import tempfile
from pathlib import Path

from program import machine, map_recording, say, understory, version

SITES = ("handheld", "harvester", "skidoo")


def rows(file, separator=None):
    lines = file.read_text().splitlines()
    return [[float(cell) for cell in line.split(separator)] for line in lines if line and line[0] in "-0123456789"]


def truth_between(folder):
    """Position of the truth at any time between its poses."""
    poses, speeds = rows(folder / "trajectory.tum"), rows(folder / "velocity.csv", ",")
    times = [row[0] for row in poses]

    def at(time):
        i = min(max(bisect.bisect_right(times, time), 1), len(times) - 1)
        step = times[i] - times[i - 1]
        u = (time - times[i - 1]) / step
        a, b, v, w = poses[i - 1][1:4], poses[i][1:4], speeds[i - 1][1:4], speeds[i][1:4]
        h = ((1 + 2 * u) * (1 - u) ** 2, u * (1 - u) ** 2 * step, u * u * (3 - 2 * u), u * u * (u - 1) * step)
        return [h[0] * a[k] + h[1] * v[k] + h[2] * b[k] + h[3] * w[k] for k in range(3)]
    return at, times[0], times[-1]


def laid_on(pairs):
    """The motion by yaw and translation that brings the first of each pair nearest to the second."""
    n = len(pairs)
    a, b = ([sum(pair[side][k] for pair in pairs) / n for k in range(3)] for side in (0, 1))
    sine = cosine = 0.0
    for p, q in pairs:
        (px, py), (qx, qy) = (p[0] - a[0], p[1] - a[1]), (q[0] - b[0], q[1] - b[1])
        sine += px * qy - py * qx
        cosine += px * qx + py * qy
    c, s = cosine / math.hypot(sine, cosine), sine / math.hypot(sine, cosine)

    def move(p):
        x, y, z = (p[k] - a[k] for k in range(3))
        return c * x - s * y + b[0], s * x + c * y + b[1], z + b[2]
    return move


def compared(file, truth):
    at, first, last = truth
    return [(row[1:4], at(row[0])) for row in rows(file) if first <= row[0] <= last]


def rmse(pairs, move):
    return math.sqrt(sum(math.dist(move(p), q) ** 2 for p, q in pairs) / len(pairs))


def measured(recording, truth, fractions, settings, folder):
    """Rows of the table: fraction, poses a second, latency, error, matched parts."""
    table = []
    for fraction in fractions:
        result = map_recording(recording, folder / "run", settings=["map.enabled=false", f"scan_fraction={fraction}",
                                                                    *settings])
        whole = compared(folder / "run" / "trajectory.tum", truth)
        move = laid_on(whole)
        if not table:
            quality = result["quality"]
            table.append((1.0, result["scans"],
                          quality["scan_latency_ms"], 1e3 * rmse(whole, move), 1.0))
        parts = compared(folder / "run" / "trajectory_partial.tum", truth)
        counts = result["counts"]
        table.append((fraction, counts["scan_parts"], result["quality"]["partial_latency_ms"], 1e3 * rmse(parts, move),
                      counts["scan_parts_matched"] / counts["scan_parts"]))
    return table


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sites", nargs="+", default=SITES)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--fractions", nargs="+", type=float, default=[0.5, 0.25, 0.125])
    parser.add_argument("--set", nargs="+", default=[], help="settings of map", metavar="KEY=VALUE")
    options = parser.parse_args()
    print(f"version {version()}, {machine()}\n\n| site | fraction | poses | matched | latency ms | of the whole | error mm "
          "| of the whole |\n|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for site in options.sites:
            say(site)
            recording = folder / f"{site}.mcap"
            understory("simulate", site, "-o", recording, "--seed", options.seed, "--duration-s", options.seconds)
            truth = truth_between(folder / f"{site}.truth")
            table = measured(recording, truth, options.fractions, options.set, folder)
            for fraction, poses, latency, error, matched in table:
                print(f"| {site} | {fraction:g} | {poses} | {100 * matched:.0f} % | {latency:.0f} | {latency / table[0][2]:.2f} "
                      f"| {error:.1f} | {error / table[0][3]:.2f} |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
