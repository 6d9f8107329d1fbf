"""The driver of all tables (benchmarks/everything.py). What a command prints is kept with version and
exit status, and a command that is done is passed over. One that failed, or that another program ran, is
run again."""

import sys
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "benchmarks"))

import everything  # noqa: E402


def check(condition, what):
    if not condition:
        sys.exit(f"everything: {what}")


def driven(folder, *options):
    """Exit status, and the words with which ./run was called."""
    calls = folder / "calls"
    calls.write_text("")
    sys.argv = ["everything.py", "--keep", str(folder / "kept"), "--only", "imu-noise", "power cut", *options]
    code = everything.main()
    return code, calls.read_text().split("\n")[:-1]


def main():
    folder = Path(tempfile.mkdtemp())
    fake = folder / "run"
    fake.write_text(f"#!/bin/sh\necho \"$@\" >>{folder}/calls\necho a table\n[ \"$2\" != --power-cut ]\n")
    fake.chmod(0o755)
    everything.TOP = folder
    check(driven(folder) == (1, ["bench imu-noise", "accuracy --power-cut"]), "both are run, and one fails")
    kept = (folder / "kept" / "imu-noise.txt").read_text()
    check("a table" in kept and everything.version() in kept and "exit status 0" in kept, kept)
    check(driven(folder) == (1, ["accuracy --power-cut"]), "what is done is passed over, what failed is not")
    fake.write_text(fake.read_text().replace("[ \"$2\" != --power-cut ]", "true"))
    check(driven(folder) == (0, ["accuracy --power-cut"]), "it is run again until it passes")
    check(driven(folder) == (0, []), "all is done")
    done = folder / "kept" / "done.jsonl"
    done.write_text(done.read_text().replace(everything.digest(), "another"))
    check(len(driven(folder)[1]) == 2, "with another program all is run again")


if __name__ == "__main__":
    main()
