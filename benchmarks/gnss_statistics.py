#!/usr/bin/env python3
"""Errors of GNSS receivers that stand still under trees, real ones beside simulated ones.

    gnss_statistics.py [--data FOLDER] [--site SITE] [--seeds N] [--set key=value ...]

FOLDER holds NMEA logs whose names begin with a plot (S01_...) and reference_data.csv with the
plots in UTM zone 32 (EPSG:25832). Each log is a row, then the same number of simulated receivers:
SITE with its carrier standing still for as long, one seed each. docs/method/simulation.md explains the
columns."""
import argparse
import csv
import math
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent


def utm32(lat_deg, lon_deg):
    """East and north on the GRS 80 ellipsoid, by Krueger's series: exact to a millimetre."""
    a, f = 6378137.0, 1 / 298.257222101
    n = f / (2 - f)
    radius = a / (1 + n) * (1 + n**2 / 4 + n**4 / 64)
    alpha = [n / 2 - 2 * n**2 / 3 + 5 * n**3 / 16, 13 * n**2 / 48 - 3 * n**3 / 5, 61 * n**3 / 240]
    lat, lon = math.radians(lat_deg), math.radians(lon_deg - 9.0)
    e = math.sqrt(f * (2 - f))
    t = math.sinh(math.atanh(math.sin(lat)) - e * math.atanh(e * math.sin(lat)))
    xi, eta = math.atan2(t, math.cos(lon)), math.asinh(math.sin(lon) / math.hypot(t, math.cos(lon)))
    north = xi + sum(c * math.sin(2 * k * xi) * math.cosh(2 * k * eta) for k, c in enumerate(alpha, 1))
    east = eta + sum(c * math.cos(2 * k * xi) * math.sinh(2 * k * eta) for k, c in enumerate(alpha, 1))
    return 500000 + 0.9996 * radius * east, 0.9996 * radius * north


def read_fixes(path):
    """Times (s of the day), degrees, heights above the ellipsoid and HDOP of the GGA sentences; and
    the times of those without a fix."""
    fixes, without = [], []
    for line in pathlib.Path(path).read_text(errors="replace").splitlines():
        cells = line.split("*")[0].split(",")
        if not cells[0].endswith("GGA") or len(cells) < 12:
            continue
        if not cells[1]:
            without.append(None)
            continue
        clock = cells[1]
        time = int(clock[:2]) * 3600 + int(clock[2:4]) * 60 + float(clock[4:])
        if cells[6] in ("", "0") or not cells[2]:
            without.append(time)
            continue
        lat = int(cells[2][:2]) + float(cells[2][2:]) / 60
        lon = int(cells[4][:3]) + float(cells[4][3:]) / 60
        height = float(cells[9]) + float(cells[11] or 0)
        fixes.append((time, lat * (1 if cells[3] == "N" else -1), lon, height, float(cells[8])))
    return np.array(fixes), without


def correlation_time(times, errors):
    """Lag at which the autocorrelation of what is left of the mean falls below 1/e (mean over the axes),
    seconds. A series that never does so lasts longer than its third can tell."""
    left = errors - errors.mean(axis=0)
    step = float(np.median(np.diff(times)))
    grid = np.arange(times[0], times[-1], step)
    series = np.stack([np.interp(grid, times, left[:, k]) for k in range(left.shape[1])], axis=1)
    power = (series**2).sum(axis=0)
    for lag in range(1, len(grid) // 3):
        r = ((series[lag:] * series[:-lag]).sum(axis=0) / np.maximum(power, 1e-12)).mean()
        if r < math.exp(-1):
            return lag * step
    return float(len(grid) // 3) * step


def statistics(times, errors, hdop, expected_rate, span):
    plane = errors[:, :2]
    steps = np.diff(times)
    rate_step = np.median(steps)
    moved = np.linalg.norm(np.diff(plane, axis=0), axis=1)[steps < 1.5 * rate_step]
    still = plane - plane.mean(axis=0)
    rms = math.sqrt((plane**2).sum(axis=1).mean())
    return {
        "span_s": span,
        "fixes_percent": 100 * len(times) / max(1.0, span * expected_rate + 1),
        "longest_gap_s": float(steps.max()),
        "plane_rms_m": rms,
        "bias_m": float(np.linalg.norm(plane.mean(axis=0))),
        "plane_sd_m": math.sqrt((still**2).sum(axis=1).mean()),
        "height_sd_m": float(errors[:, 2].std()),
        "height_rms_m": math.sqrt((errors[:, 2] ** 2).mean()),
        "correlation_s": correlation_time(times, plane),
        "step_p50_m": float(np.median(moved)),
        "step_max_m": float(moved.max()),
        "hdop": float(np.median(hdop)),
        "rms_per_hdop_m": rms / float(np.median(hdop)),
    }


def real_logs(folder):
    places = {}
    with open(folder / "reference_data.csv") as table:
        for row in csv.DictReader(table):
            places[row["plot"]] = [float(row[k]) for k in ("ostwert", "nordwert", "hoehe_z")]
    for log in sorted(folder.glob("*.nmea")):
        fixes, without = read_fixes(log)
        if len(fixes) < 20:
            continue
        truth = np.array(places[log.name[:3]])
        errors = np.array([[*utm32(f[1], f[2]), f[3]] for f in fixes]) - truth
        known = [t for t in without if t is not None] + list(fixes[:, 0])
        span = max(max(known) - min(known), float(len(fixes) + len(without) - 1))
        yield log.stem, statistics(fixes[:, 0], errors, fixes[:, 4], 1.0, span)


def simulated(program, site, seed, span, settings):
    """The receiver of a site whose carrier stands still; lidar and IMU are turned down."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "still.pcap"
        keys = [f"seed={seed}", f"duration_s={span}", f"carrier.still_s={span + 10}", "gnss.rate_hz=1",
                "lidar.model=VLP-16", "lidar.keep_every=100", "lidar.rays_per_beam=1",
                "lidar.fov_deg=20", "lidar.range_step_m=0.002", "imu.enabled=false", *settings]
        command = [str(program), "simulate", site, "-o", str(out), "--seed", str(seed)]
        for key in keys[1:]:
            command += ["--set", key]
        subprocess.run(command, check=True, capture_output=True)
        fixes, _ = read_fixes(out.with_suffix(".nmea"))
        rows = np.loadtxt(out.with_suffix(".truth") / "trajectory.tum", ndmin=2)
        site_file = (out.with_suffix(".truth") / "site.yaml").read_text()
    value = lambda key: float(site_file.split(f"{key}: ")[1].split()[0].strip(","))
    lat0, lon0, up0 = value("latitude_deg"), value("longitude_deg"), value("height_m")
    # Metres of a degree at the origin: the errors are small.
    s = math.sin(math.radians(lat0))
    e2 = 0.00669437999014
    north = 6378137.0 * (1 - e2) / (1 - e2 * s * s) ** 1.5
    east = 6378137.0 / math.sqrt(1 - e2 * s * s) * math.cos(math.radians(lat0))
    mount = site_file.split("gnss:")[1].split("mount_m: [")[1].split("]")[0]
    body = rows[0, 1:4] + np.array([float(x) for x in mount.split(",")])
    errors = np.stack([np.radians(fixes[:, 2] - lon0) * (east + up0),
                       np.radians(fixes[:, 1] - lat0) * (north + up0), fixes[:, 3] - up0], axis=1)
    return statistics(fixes[:, 0], errors - body, fixes[:, 4], 1.0, span)


COLUMNS = [("span_s", "span s", 7, 0), ("fixes_percent", "fixes %", 8, 0), ("longest_gap_s", "gap s", 6, 0),
           ("plane_rms_m", "plane", 7, 2), ("bias_m", "bias", 7, 2), ("plane_sd_m", "sd", 6, 2),
           ("height_rms_m", "height", 7, 2), ("height_sd_m", "sd", 6, 2), ("correlation_s", "corr s", 7, 0),
           ("step_p50_m", "step", 6, 3), ("step_max_m", "max", 6, 2), ("hdop", "HDOP", 6, 2),
           ("rms_per_hdop_m", "/HDOP", 7, 2)]


def say(name, row):
    print(f"{name:24}" + "".join(f"{row[key]:{width}.{digits}f}" for key, _, width, digits in COLUMNS),
          flush=True)


def say_median(name, rows):
    say(name, {key: float(np.median([row[key] for row in rows])) for key, *_ in COLUMNS})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--data", default=os.environ.get("UNDERSTORY_DATA", ROOT.parent / "shared/data"))
    parser.add_argument("--program", default=ROOT / "build/understory")
    parser.add_argument("--site", action="append", default=[])
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--set", action="append", default=[], dest="settings")
    options = parser.parse_args()
    folder = pathlib.Path(options.data) / "gnss_canopy"
    print(f"{'metres unless said':24}" + "".join(f"{title:>{width}}" for _, title, width, _ in COLUMNS))
    real = []
    if folder.is_dir():
        for name, row in real_logs(folder):
            say(name, row)
            real.append(row)
        say_median("median of the logs", real)
    else:
        print(f"{folder}: absent, simulated receivers alone", file=sys.stderr)
    span = int(np.median([row["span_s"] for row in real])) if real else 300
    for site in options.site or ["handheld"]:
        rows = [simulated(options.program, site, seed, span, options.settings)
                for seed in range(1, options.seeds + 1)]
        for seed, row in enumerate(rows, 1):
            say(f"{site} seed {seed}", row)
        say_median(f"median of {site}", rows)


if __name__ == "__main__":
    main()
