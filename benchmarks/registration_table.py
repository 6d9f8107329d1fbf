"""Scans of one stand matched without a guess: how many answers are right before the verdict. How many
wrong ones it trusts and right ones it refuses, by overlap and sensor.

    registration_table.py [--seeds 1,2] [--scans 24] [--folder KEEP]      ./run bench registration

Scans come from the simulator (pair_scans). Pairs of a recording are matched with each other, and with
those of another seed, which show another place (global_pairs). Right is within 0.5 m and 2 degrees. The
overlap is the share of the source's points within about 0.5 m of the target at the true pose.
"""

import argparse
import json
import os
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BUILD = Path(os.environ.get("UNDERSTORY_BUILD", ROOT / "build")) / "benchmarks"
SENSORS = {"handheld, 128 rings": ["handheld"], "evo1, 128 rings": ["evo1"],
           "handheld, 64 rings": ["handheld", "lidar.model=OS1-64"],
           "harvester, 16 rings": ["harvester"], "lohja1, 16 rings": ["lohja1"]}
TRUSTED = 0.95  # match_verdict::kTrusted
BANDS = ((0.0, 0.3), (0.3, 0.45), (0.45, 0.6), (0.6, 1.01))


def pairs(a, b):
    done = subprocess.run([BUILD / "global_pairs", a, b, "30"], check=True, capture_output=True,
                          text=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


def scans(folder, sensor, seed, count):
    site, *settings = SENSORS[sensor]
    place = folder / f"{sensor.replace(', ', '_').replace(' ', '_')}_{seed}"
    if not (place / "poses.txt").exists():
        subprocess.run([BUILD / "pair_scans", site, str(seed), str(count), place, *settings],
                       check=True)
    return place


def row(name, found):
    best = [pair["poses"][0] for pair in found if pair["poses"]]
    right = [pose for pose in best if pose["off_m"] < 0.5 and pose["off_deg"] < 2.0]
    trusted = [pose for pose in best if pose["right"] >= TRUSTED]
    wrong = sum(pose not in right for pose in trusted)
    refused = sum(pose not in trusted for pose in right)
    mean = lambda key: sum(pair[key] for pair in found) / len(found)
    print(f"{name:34} {len(found):5} {100 * len(right) / len(found):7.1f} {wrong:8} {refused:8} "
          f"{mean('prepare_ms'):8.0f} {mean('search_ms') + mean('weigh_ms'):8.0f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", default="1,2")
    parser.add_argument("--scans", type=int, default=24)
    parser.add_argument("--folder", type=Path, help="where scans are kept")
    options = parser.parse_args()
    seeds = [int(seed) for seed in options.seeds.split(",")]
    print(f"{'sensor, overlap':34} pairs right % wrong+0 refused  prepare   search (ms CPU)")
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.folder or Path(scratch)
        for sensor in SENSORS:
            places = [scans(folder, sensor, seed, options.scans) for seed in seeds]
            found = [pair for place in places for pair in pairs(place, place)]
            for low, high in BANDS:
                part = [pair for pair in found if low <= pair["overlap"] < high]
                if part:
                    row(f"{sensor}, {100 * low:.0f} to {100 * high:.0f} %", part)
            for one, other in zip(places, places[1:]):
                row(f"{sensor}, other places", pairs(one, other))


if __name__ == "__main__":
    main()
