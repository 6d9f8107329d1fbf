"""`./run bench weather`: what the weather filter (`preprocess.weather`) takes out, and what it does to path and trees.

Four sites, one for each kind of weather. Points: of the weather and of all else, those that were dropped, counted with
the truth of the simulator and the true poses. Path: APE RMSE (SE(3)) of runs in the weather with and without the filter,
beside a run without weather. Trees: false ones of those listed within 15 m of the path, and the error of heights.
Python standard library only."""

import argparse
import os
import sys
import tempfile
from pathlib import Path

from program import TOP, machine, map_recording, run, say, simulated, truth_of, understory_json, version

POINTS = Path(os.environ.get("UNDERSTORY_WEATHER_POINTS", TOP / "build" / "benchmarks" / "weather_points"))
CLEAR = {"lidar.snow_fall_per_m": 0, "lidar.snow_drop_interval_s": 0, "lidar.crosstalk": 0}
# Site, and what is added to clear weather.
WEATHER = {
    "snow falls": ("skidoo", {"lidar.snow_fall_per_m": 0.002}),
    "snow off branches": ("lake", {"lidar.snow_drop_interval_s": 7}),
    "cold lidar": ("tuusniemi1", {"lidar.cold_noise": 0.1}),
    "low sun": ("harvester", {"lidar.sun_noise": 0.3, "lidar.sun_azimuth_deg": 90}),
}
FILTER = ["preprocess.weather.enabled=true"]


def points(site, keys, apart, scans):
    """Shares of the weather and of all else that are dropped; of the latter by drop_isolated alone."""
    settings = [f"{key}={value}" for key, value in keys.items()]
    counts = run(POINTS, apart, scans, site, *settings).stdout.split()
    weather, dropped, other, lost, isolated = map(int, counts)
    return dropped / max(weather, 1), lost / max(other, 1), isolated / max(other, 1), weather / (weather + other)


def path_and_trees(folder, recording, settings):
    map_recording(recording, folder, settings=settings)
    error = 100.0 * understory_json("evaluate", folder, truth_of(folder), "--align", "se3")["ape_rmse_m"]
    truth = truth_of(folder)
    seen = understory_json("evaluate", "trees", folder, truth, "--matching", "nearest", "--align", "yaw",
                           "--truth-returns", truth, "--path", truth, "--within-m", 15, "--min-returns", 30)
    false, listed = seen["visible"]["false_share"], seen["visible"]["reported"]
    height = seen.get("height_rmse_m")
    return (error, f"{round((false or 0) * listed)} of {listed}", "" if height is None else f"{height:.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", nargs="+", default=list(WEATHER), choices=list(WEATHER))
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--point-seconds", type=float, default=8.0, help="of the counts of points")
    parser.add_argument("--apart", type=float, default=0.111)
    parser.add_argument("--scans", type=int, default=3)
    parser.add_argument("--only-points", action="store_true")
    options = parser.parse_args()
    print(f"version {version()}, {machine()}, seed {options.seed}\n\n"
          "| weather | site | share of the points | removed of it % | of the others % (by lone returns) "
          "| APE cm: clear, weather, filtered | filtered / clear | false trees: the same | heights m |\n"
          "|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        for kind in options.kinds:
            site, added = WEATHER[kind]
            keys = {"seed": options.seed, **CLEAR}
            say(kind)
            removed, lost, isolated, share = points(site, {**keys, "duration_s": options.point_seconds, **added},
                                                    options.apart, options.scans)
            cells = ["", "", "", ""]
            if not options.only_points:
                rows = []
                for name, extra, settings in (("clear", {}, []), ("weather", added, []), ("filtered", added, FILTER)):
                    recording = simulated(site, **{**keys, "duration_s": options.seconds, **extra})
                    rows.append(path_and_trees(Path(scratch) / f"{site}_{name}", recording, settings))
                cells = [", ".join(f"{row[0]:.2f}" for row in rows), f"{rows[2][0] / rows[0][0]:.2f}",
                         ", ".join(row[1] for row in rows), ", ".join(row[2] for row in rows)]
            print(f"| {kind} | {site} | {100 * share:.1f} % | {100 * removed:.1f} | {100 * lost:.2f} ({100 * isolated:.2f}) "
                  f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
