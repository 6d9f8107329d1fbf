"""`./run accuracy --power-cut`: the power is cut at 200 random moments of a run, 100 by each front end.

A moment is one of the system calls by which the run changes the disk. Half of them are drawn from all
calls, half from the recording's time. What the disk then holds is drawn too (tests/durability/disk.py
says by which rules). At every fifth moment the newest checkpoint is broken besides. Python standard
library only.
"""

import argparse
import bisect
import concurrent.futures
import os
import random
import sys
import tempfile
from pathlib import Path

from program import PROGRAM, TOP, say, understory

sys.path.insert(0, str(TOP / "tests" / "durability"))
from cuts import Run  # noqa: E402: found by the line above

INTERVAL_S = 4.0
MOST_AGAIN_S = 5.0
LIBRARY = Path(os.environ.get("UNDERSTORY_POWER_CUT", TOP / "build" / "tests" / "libpower_cut.so"))
SITES = {"dense": "harvester", "sparse": "harvester"}


def record(site, front_end, seconds, seed, scratch):
    recording = scratch / f"{front_end}.mcap"
    settings = [f"seed={seed}", f"duration_s={seconds}", "lidar.model=VLP-16"]
    understory("simulate", site, "-o", recording, *(word for s in settings for word in ("--set", s)))
    return Run(PROGRAM, LIBRARY, recording, scratch, front_end, INTERVAL_S)


def draw_moments(run, count, dice):
    stamps = [-1.0 if stamp is None else stamp for stamp in run.reached]
    first, last = next(s for s in stamps if s >= 0), stamps[-1]
    for k in range(count):
        if k % 2:
            yield bisect.bisect_left(stamps, dice.uniform(first, last)) + dice.randrange(12), k % 5 == 0
        else:
            yield dice.randrange(len(run.calls) + 1), k % 5 == 0


def row(front_end, cuts, broken):
    chosen = [cut for cut in cuts if cut.spoilt == broken]
    again = sorted(cut.again_s for cut in chosen)
    lost = sum(cut.outcome not in ("resumed", "begun anew", "finished") for cut in chosen)
    if not chosen:
        return ""
    return (f"| {front_end}{', the newest checkpoint broken' if broken else ''} | {len(chosen)} | {lost} "
            f"| {sum(bool(cut.different) for cut in chosen)} "
            f"| {sum(again) / len(again):.1f} | {again[-1]:.1f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--moments", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=40.0, help="of recording")
    parser.add_argument("--seed", type=int, default=11, help="of recording and moments")
    parser.add_argument("--front-end", choices=["dense", "sparse"], help="only that one")
    options = parser.parse_args()
    print("| front end | moments | runs lost | with other bytes | processed again, mean s | most s |")
    print("|---|---|---|---|---|---|")
    failed = []
    with tempfile.TemporaryDirectory() as scratch, concurrent.futures.ThreadPoolExecutor(2) as pool:
        for front_end in [options.front_end] if options.front_end else ["dense", "sparse"]:
            run = record(SITES[front_end], front_end, options.seconds, options.seed, Path(scratch).resolve())
            say(f"{front_end}: {len(run.calls)} calls")
            dice = random.Random(options.seed)
            drawn = [(min(number, len(run.calls)), spoil)
                     for number, spoil in draw_moments(run, options.moments // 2, dice)]
            cuts = list(pool.map(lambda pair, run=run: run.cut(pair[1][0], pair[0], spoil=pair[1][1]),
                                 enumerate(drawn)))
            for cut in cuts:
                most = MOST_AGAIN_S + (INTERVAL_S if cut.spoilt else 0.0)
                if not cut.good or cut.again_s > most:
                    failed.append(cut)
                    say(f"MISSED: {front_end}, call {cut.number}, seed {cut.seed} ({cut.call}, {cut.mode}): "
                        f"{cut.outcome}, {cut.again_s:.1f} s again, {cut.different}")
            for broken in (False, True):
                print(row(front_end, cuts, broken), flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
