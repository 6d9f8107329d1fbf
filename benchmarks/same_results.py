"""Whether two builds of the program make the same files, byte for byte, of three recordings.

  python3 benchmarks/same_results.py BEFORE AFTER              two programs, each `build/understory`
  python3 benchmarks/same_results.py --write FILE BEFORE       the hashes of one, kept in FILE
  python3 benchmarks/same_results.py --against FILE AFTER      the other one, held against FILE

For a change that must not touch results. Hashes are of one machine: another compiler or processor may round
otherwise. Exit status 1: a file differs or is missing. Python standard library only.
"""

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path

SEED = 19
RUNS = {
    "handheld": ["sim:handheld"],
    "harvester": ["sim:harvester"],
    "lieksa2": ["sim:lieksa2"],
    "lieksa2 by stems": ["sim:lieksa2", "--front-end", "sparse"],
}
FILES = ["trajectory.tum", "states.csv.gz", "map.laz", "trees.csv", "stems.csv.gz"]


def hashes(program, seconds):
    found = {}
    for name, (site, *options) in RUNS.items():
        with tempfile.TemporaryDirectory() as scratch:
            run = Path(scratch) / "run"
            done = subprocess.run([program, "--quiet", "map", f"{site}?seed={SEED}&duration_s={seconds:g}",
                                   "-o", run, *options], capture_output=True, text=True)
            if done.returncode not in (0, 4):
                sys.exit(f"{program}: {name}: exit {done.returncode}: {done.stderr}")
            for file in FILES:
                if (run / file).exists():
                    found[f"{name}/{file}"] = hashlib.sha256((run / file).read_bytes()).hexdigest()
        print(f"{program}: {name}: {done.stdout.splitlines()[0]}", flush=True)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("programs", nargs="+")
    parser.add_argument("--seconds", type=float, default=60.0, help="of each recording")
    parser.add_argument("--write", type=Path)
    parser.add_argument("--against", type=Path)
    options = parser.parse_args()
    if len(options.programs) != (1 if options.write or options.against else 2):
        parser.error("two programs, or one with --write or --against")
    if options.against:
        kept = json.loads(options.against.read_text())
        before, options.seconds = kept["files"], kept["seconds"]
    else:
        before = hashes(options.programs[0], options.seconds)
    if options.write:
        options.write.write_text(json.dumps({"seconds": options.seconds, "files": before}, indent=1) + "\n")
        return 0
    after = hashes(options.programs[-1], options.seconds)
    different = sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))
    for name in different:
        print(f"DIFFERENT: {name}")
    print(f"{len(before)} files, {len(different)} differ")
    return 1 if different or len(before) < len(RUNS) * 2 else 0


if __name__ == "__main__":
    sys.exit(main())
