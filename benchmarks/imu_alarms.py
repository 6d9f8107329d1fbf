#!/usr/bin/env python3
"""`./run accuracy --imu-alarms`: is a good IMU ever doubted, and is each wrong one found?

  ./run accuracy --imu-alarms                          all sites with an IMU, seeds 61 to 63, 180 s; 12 wrong ones a way
  ./run accuracy --imu-alarms --seeds 1 --seconds 60   seeds to tune on (to 19), shorter recordings
  ./run accuracy --imu-alarms --only good              no wrong IMUs; `--only wrong`: nothing else
  ./run accuracy --imu-alarms --keep DIR               rows stay there; run again, it goes on where it was

A good IMU raises a false alarm if run.json says that it is not trusted or not used. One that was
doubted for any time does, too, and one that a warning names for its clock or axes.

A wrong IMU is found if the run does not trust it, or if a reason or a warning names it. Wrong are axes (x and y
swapped), units (degrees a second) and the clock (0.1 s early or late). The fourth one hangs upside down against
its extrinsics. Recordings of four sites last 30 s. Lidars are VLP-16 there, so that a script can edit the recordings.
Floors: no false alarm; all wrong ones found. Needs numpy.
"""

import argparse
import json
import random
import re
import sys
from pathlib import Path

from program import DONE, PROGRAM, UNTRUSTED, KeptRows, machine, map_recording, run, say, simulated, understory, version
from spoil import IMU_WORDS, WAYS, read_mcap, whole, write_mcap

GOOD_SITES = ["handheld", "harvester", "evo1", "evo2", "evo3", "tuusniemi1", "tuusniemi3", "lohja1", "lohja2", "hover",
              "swing", "lake", "forest", "skidoo", "mid360", "demo"]
WRONG_SITES = {"handheld": ["lidar.model=VLP-16"], "lohja1": [], "lake": [], "harvester": []}
WRONG_WAYS = ["IMU's x and y swapped", "gyroscope in degrees per second", "IMU's clock off by 0.1 s",
              "IMU turned by 180 degrees"]
WRONG_S = 30
ALARMS = ("imu.clock", "imu.axes", "imu.untrusted", "imu.probation")


def alarm(told):
    """What run.json says against the IMU; empty: nothing."""
    evidence = told.get("evidence", {})
    said = [key for key in ("imu_on_probation", "imu_cleared") if evidence.get(key)]
    said += [f"not {key}" for key in ("imu_trusted", "imu_used") if evidence.get(key) is False]
    if evidence.get("imu_doubted_s", 0) > 0:
        said.append(f"doubted for {evidence['imu_doubted_s']:.1f} s")
    return said + [w["key"] for w in told["warnings"] if w["key"] in ALARMS]


def good(work, site, seed, seconds):
    told = map_recording(simulated(site, seed=seed, duration_s=seconds, **{"gnss.enabled": "false"}), work / "run",
                         settings=("map.enabled=false",))
    return {"status": told["status"], "said": alarm(told), "reasons": told.get("reasons", [])}


class Walks:
    """The messages of recordings; the last one is held."""

    def __init__(self, work):
        self.work, self.key, self.walk = work, None, None

    def get(self, site, seed):
        if self.key != (site, seed):
            packed, plain = self.work / "packed.mcap", self.work / "plain.mcap"
            words = [w for s in [*WRONG_SITES[site], "gnss.enabled=false"] for w in ("--set", s)]
            understory("simulate", site, "-o", packed, "--overwrite", "--seed", seed, "--duration-s", WRONG_S, *words)
            understory("convert", packed, plain, "--overwrite", "--compression", "none")
            self.key, self.walk = (site, seed), whole(read_mcap(plain))
            plain.unlink()
        return self.walk


def wrong(work, walks, site, seed, name):
    way = next(w for w in WAYS if w.name == name)
    write_mcap(work / "wrong.mcap", way.spoil(walks.get(site, seed), random.Random(f"{site} {seed} {name}")).messages)
    done = run(PROGRAM, "--quiet", "map", work / "wrong.mcap", "-o", work / "run", "--overwrite", "--set",
               "map.enabled=false")
    if done.code not in (DONE, UNTRUSTED):
        return {"status": f"exit {done.code}", "said": [done.stderr.strip()[-200:]], "reasons": [],
                "found": bool(re.search(IMU_WORDS, done.stderr))}
    told = json.loads((work / "run" / "run.json").read_text())
    said = alarm(told)
    texts = [*told.get("reasons", []), *(w["message"] for w in told["warnings"] if w["key"].startswith("imu"))]
    return {"status": told["status"], "said": said, "reasons": told.get("reasons", []),
            "found": bool(said) or any(re.search(way.cause, text) for text in texts)}


def main():
    parser = argparse.ArgumentParser(prog="./run accuracy --imu-alarms", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", nargs="+", default=GOOD_SITES, choices=GOOD_SITES)
    parser.add_argument("--wrong-sites", nargs="+", default=list(WRONG_SITES), choices=WRONG_SITES)
    parser.add_argument("--seeds", type=int, nargs="+", default=[61, 62, 63])
    parser.add_argument("--seconds", type=float, default=180.0, help="of the recordings with a good IMU")
    parser.add_argument("--only", choices=["good", "wrong"])
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    rows, alarms, missed, counts = KeptRows(options.keep, "imu"), [], [], [0, 0]
    work = rows.folder
    print(f"{version()}, {machine()}")
    if options.only != "wrong":
        for site in options.sites:
            for seed in options.seeds:
                row = rows.get(f"good {site} {seed} {options.seconds:g}", lambda: good(work, site, seed, options.seconds))
                counts[0] += 1
                alarms += [f"{site} {seed}"] * bool(row["said"])
                print(f"good   {site:11} {seed:4}  {row['status']:9} {'; '.join(row['said']) or 'no alarm'}", flush=True)
    if options.only != "good":
        walks = Walks(work)
        for site in options.wrong_sites:
            for seed in options.seeds:
                for name in WRONG_WAYS:
                    row = rows.get(f"wrong {site} {seed} {name}", lambda: wrong(work, walks, site, seed, name))
                    counts[1] += 1
                    missed += [f"{site} {seed} {name}"] * (not row["found"])
                    print(f"wrong  {site:11} {seed:4}  {name:31} {row['status']:9} "
                          f"{'found: ' if row['found'] else 'MISSED'}{'; '.join(row['said'])}", flush=True)
    print(f"false alarms: {len(alarms)} of {counts[0]} {'; '.join(alarms)}")
    print(f"wrong IMUs that were missed: {len(missed)} of {counts[1]} {'; '.join(missed)}")
    for text in alarms + missed:
        say(f"floor missed: {text}")
    return 1 if alarms or missed else 0


if __name__ == "__main__":
    sys.exit(main())
