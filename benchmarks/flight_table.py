#!/usr/bin/env python3
"""`./run accuracy --flights`: table 1 of P2, errors of whole flights without GNSS, with it, and with it cut.

  ./run accuracy --flights                        lohja1 and lohja2, seed 48, all points and tree tops
  ./run accuracy --flights --seeds 3 --cut 40 100    GNSS silent from 40 to 100 s of the recording
  ./run accuracy --flights --seconds 60           only the first minute
  ./run accuracy --flights --write                puts the table into docs/method/odometry.md

Flights are mapped by the profile `uav`. Errors after one motion in space (SE(3)): APE, RPE over 10 m, velocity along each axis. Beside them the errors
as the run lies on the globe: each pose is taken to the site's origin by the place that run.json tells. A run
that knows no place has none. Recordings are simulated once for all runs of a site and a seed. What was measured
is kept (`--keep`), so that a table that was stopped goes on where it was. Needs numpy.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from figures.data import enu, origin_of, paired, read_path, rms
from program import TOP, KeptRows, digest, machine, map_recording, say, understory, understory_json, version

PAGE = TOP / "docs" / "method" / "odometry.md"
BEGIN, END = "<!-- flights table: ./run accuracy --flights --write -->", "<!-- end of flights table -->"
POINTS = {"all": (), "tree tops": ("preprocess.points=tree_tops",)}
# GNSS of a row, settings of `map`, whether the recording is the one with the cut.
WAYS = {
    "none": (("gnss.use=georeference", "gnss.match.use=none"), False),
    "in the graph": (("gnss.use=fuse",), False),
    "in the match": (("gnss.match.use=penalty",), False),
    "in the graph, cut": (("gnss.use=fuse",), True),
    "in the match, cut": (("gnss.match.use=penalty",), True),
}
HEAD = ("| site, seed | points | GNSS | APE cm | RPE 10 m cm | velocity x, y, z cm/s | on the globe: APE, in the plane m "
        "| heading ° | status |")


def turn_of(quaternion):
    """The rotation matrix of x y z w."""
    x, y, z, w = quaternion
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def on_globe(run, truth, told):
    """(APE, the same in the plane, error of the heading in degrees) where the run says that it lies; None: nowhere."""
    place = told.get("georeference", {})
    if not place.get("on_globe"):
        return None
    ours, true = read_path(run / "trajectory.tum"), read_path(truth / "trajectory.tum")
    turn = turn_of(place["enu_from_world"]["rotation_xyzw"])
    origin = place["origin"]
    shift = np.array(place["enu_from_world"]["translation_m"]) + enu(
        origin["latitude_deg"], origin["longitude_deg"], origin["height_m"], origin_of(truth))
    i, j = paired(ours.times, true.times)
    off = ours.places[i] @ turn.T + shift - true.places[j]
    turns = turn @ ours.rotations()[i] @ np.transpose(true.rotations()[j], (0, 2, 1))
    heading = np.degrees(np.arctan2(turns[:, 1, 0] - turns[:, 0, 1], turns[:, 0, 0] + turns[:, 1, 1]))
    return rms(np.linalg.norm(off, axis=1)), rms(np.linalg.norm(off[:, :2], axis=1)), rms(heading)


def recorded(work, site, seed, seconds, cut):
    """A recording with its receiver, silent for the seconds of `cut`."""
    name = f"{digest()}_{site}_{seed}_{seconds:g}" + (f"_{cut[0]:g}_{cut[1]:g}" if cut else "")
    file = work / f"{name}.mcap"
    if not file.exists():
        words = ["--duration-s", seconds] if seconds else []
        if cut:
            words += ["--set", f"gnss.silent_s=[{cut[0]:g},{cut[1]:g}]"]
        understory("simulate", site, "-o", file, "--seed", seed, *words)
    return file


def measured(work, recording, name, settings):
    run, truth = work / name, recording.with_suffix(".truth")
    told = map_recording(recording, run, settings=("map.enabled=false", *settings), more=("--profile", "uav"))
    errors = understory_json("evaluate", run, truth, "--align", "se3")
    return {"ape": errors["ape_rmse_m"], "rpe": errors["rpe"][0]["translation_rmse_m"],
            "velocity": errors.get("velocity_rmse_m_s"), "globe": on_globe(run, truth, told),
            "status": told["status"], "reasons": told.get("reasons", []),
            "warnings": [w["key"] for w in told["warnings"] if w["key"].startswith("gnss")]}


def number(value, decimals=2, scale=1.0):
    return "-" if value is None else f"{scale * value:.{decimals}f}"


def row_of(site, seed, points, way, found):
    velocity = found["velocity"]
    globe = found["globe"]
    status = "; ".join([found["status"], *found["reasons"], *found["warnings"]]).replace("|", "/")
    return (f"| `{site}`, {seed} | {points} | {way} | {number(found['ape'], 2, 100)} | {number(found['rpe'], 2, 100)} | "
            + ("-" if velocity is None else ", ".join(number(v, 2, 100) for v in velocity)) + " | "
            + ("-" if globe is None else f"{globe[0]:.2f}, {globe[1]:.2f}") + " | "
            + ("-" if globe is None else f"{globe[2]:.2f}") + f" | {status} |")


def write(table):
    text = PAGE.read_text()
    head, rest = text.split(BEGIN, 1)
    PAGE.write_text(f"{head}{BEGIN}\n{table}{END}{rest.split(END, 1)[1]}")


def main():
    parser = argparse.ArgumentParser(prog="./run accuracy --flights", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", nargs="+", default=["lohja1", "lohja2"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[48])
    parser.add_argument("--points", nargs="+", choices=POINTS, default=list(POINTS))
    parser.add_argument("--gnss", nargs="+", choices=WAYS, default=list(WAYS))
    parser.add_argument("--cut", type=float, nargs=2, default=[40.0, 100.0], metavar=("FROM", "TO"))
    parser.add_argument("--seconds", type=float, default=0.0, help="only the first part of each flight")
    parser.add_argument("--keep", type=Path, help="recordings, runs and rows stay here")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    kept, rows = KeptRows(options.keep, "flights"), []
    for site in options.sites:
        for seed in options.seeds:
            for points in options.points:
                for way in options.gnss:
                    settings, cut = WAYS[way]
                    cut = options.cut if cut else None

                    def make():
                        recording = recorded(kept.folder, site, seed, options.seconds, cut)
                        return measured(kept.folder, recording, "run", (*POINTS[points], *settings))

                    found = kept.get(f"{site} {seed} {options.seconds:g} {points} {way} {cut}", make)
                    rows.append(row_of(site, seed, points, way, found))
                    say(rows[-1])
    rule = "|" + "---|" * (HEAD.count("|") - 1)
    part = f"the first {options.seconds:g} s" if options.seconds else "whole flights"
    table = (f"{version()}, {part}, GNSS cut from {options.cut[0]:g} to {options.cut[1]:g} s, {machine()}.\n\n"
             + "\n".join([HEAD, rule, *rows]) + "\n")
    print(table)
    if options.write:
        write(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
