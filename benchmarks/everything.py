#!/usr/bin/env python3
"""`./run accuracy --everything`: the commands that print the tables of the documentation, one after the other.

  ./run accuracy --everything                    all of them, hours; run again, it goes on where it was
  ./run accuracy --everything --list             what there is, and what is done with this program
  ./run accuracy --everything --only faults peers   those with these words in their names
  ./run accuracy --everything --seed 41          the seed of tables of one seed (default 41; to 19: tuning)
  ./run accuracy --everything --write            lets the commands put their tables into the pages

What a command prints goes to out/everything/NAME.txt (`--keep` names another folder). At its head stand
version and digest of the program, date, seconds and exit status. A line goes to
out/everything/done.jsonl. A command that is done with this program is passed over, one that failed or
was stopped is run again. Many of them keep their own rows and go on in the middle. Exit status 1 if a
command failed. Python standard library only.
"""

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

from program import PROGRAM, TOP, digest, machine, say, version
from sites import SITES


def steps(seed, keep):
    """(name, words after ./run, whether it takes --write) in the order in which they run."""
    three = [str(s) for s in range(seed, seed + 3)]
    one = [str(seed)]
    yield "accuracy floors", ["accuracy", "--sites", "floors", "--seeds", *three], True
    yield "accuracy sites", ["accuracy", "--sites", "all", "--seeds", *one], True
    yield "accuracy whole sites", ["accuracy", "--sites", "all", "--whole", "--seeds", *one], True
    yield "faults", ["accuracy", "--faults", "--seeds", *one, "--peers", "--keep", str(keep / "faults")], True
    yield "spoilt", ["accuracy", "--spoilt", "--keep", str(keep / "spoilt")], True
    yield "speed", ["bench"], True
    for site in ["handheld", "harvester", *SITES]:
        yield f"peers {site}", ["bench", "peers", "--sites", site, "--duration-s", "180", "--seed", *one], True
    for name in ("stems", "georeference", "registration", "registration-peers", "match-noise", "online",
                 "imu-noise", "parts", "weather", "resume"):
        yield name, ["bench", name], False
    yield "power cut", ["accuracy", "--power-cut"], False
    yield "checkpoint cost", ["accuracy", "--checkpoint-cost"], False
    yield "figures", ["accuracy", "--figures", "-o", str(keep / "figures")], True


class Record:
    """What was done with this program."""

    def __init__(self, folder):
        self.folder, self.file = folder, folder / "done.jsonl"
        self.program = digest()
        self.rows = [json.loads(line) for line in self.file.read_text().splitlines()] if self.file.exists() else []

    def last(self, name, words):
        mine = [r for r in self.rows
                if r["name"] == name and r["words"] == words and r["program"] == self.program]
        return mine[-1] if mine else None

    def put(self, row):
        self.rows.append(row)
        with open(self.file, "a") as file:
            file.write(json.dumps(row) + "\n")


def run_step(record, name, words):
    """Exit status of a command; what it prints is kept."""
    say(f"{name}: ./run {' '.join(words)}")
    begin, path = time.time(), record.folder / f"{name.replace(' ', '_')}.txt"
    part = path.with_suffix(".part")
    with open(part, "w") as out:
        code = subprocess.run([TOP / "run", *words], cwd=TOP, stdout=out).returncode
    row = {"name": name, "words": words, "program": record.program, "version": version(),
           "date": time.strftime("%Y-%m-%d"), "seconds": round(time.time() - begin), "code": code}
    head = f"{row['version']} ({row['program']}), {row['date']}, {machine()}; {row['seconds']} s, exit status {code}"
    path.write_text(f"{head}\n./run {' '.join(words)}\n\n{part.read_text()}")
    part.unlink()
    record.put(row)
    return code


def main():
    parser = argparse.ArgumentParser(prog="./run accuracy --everything", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--only", nargs="+", default=[""], metavar="WORD")
    parser.add_argument("--seed", type=int, default=41)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--keep", type=Path, default=TOP / "out" / "everything", metavar="DIR")
    options = parser.parse_args()
    options.keep.mkdir(parents=True, exist_ok=True)
    if not PROGRAM.exists():
        parser.error(f"{PROGRAM} is not there: ./run build")
    record, failed = Record(options.keep.resolve()), []
    chosen = [(name, words + ["--write"] * (can_write and options.write))
              for name, words, can_write in steps(options.seed, record.folder)
              if any(word in name for word in options.only)]
    if not chosen:
        parser.error("--only: no command has that in its name (--list)")
    for name, words in chosen:
        last = record.last(name, words)
        if options.list:
            told = "not done" if last is None else f"{last['date']}, exit status {last['code']}"
            print(f"{name:24} {told:28} ./run {' '.join(words)}")
        elif last is not None and last["code"] == 0:
            say(f"{name}: done with this program on {last['date']}")
        elif run_step(record, name, words) != 0:
            failed.append(name)
    if failed:
        say(f"failed or below a floor: {', '.join(failed)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
