"""A working day (benchmarks/day.py) on a short run of the program. The row holds the run's own figures,
and tells memory that grows and scans that take ever longer. A run that was killed goes on."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "benchmarks"))

import day  # noqa: E402

TENTHS = [1.0] + 9 * [2.0]


def result(half, end, tenths, resumed=False):
    return {"quality": {"memory_mb_half": half, "memory_mb_end": end}, "resumed": resumed, "scans": 7,
            "stages": {"scan": {"cpu_ms_by_tenth": tenths}}, "process": {"peak_memory_mb": 300.0}, "status": "complete"}


def check(condition, what):
    if not condition:
        sys.exit(f"working_day: {what}")


def test_floors():
    check(day.missed("stems", result(100.0, 105.0, TENTHS)) == [], "a run within the floors is said to miss one")
    check(len(day.missed("stems", result(100.0, 120.0, TENTHS))) == 1, "growing memory is not told")
    check(len(day.missed("stems", result(100.0, 100.0, TENTHS[:-1] + [2.5]))) == 1, "slower scans are not told")
    check(day.missed("stems", result(10.0, 120.0, TENTHS, True)) == [], "memory of a resumed run is compared")


def test_recording():
    name = day.recording("stems", 2, 3)
    for key in ("sim:lieksa2?", "seed=3", "duration_s=7200", "carrier.rounds=19", "carrier.route=loop"):
        check(key in name, f"{key} is not in {name}")


# A run that is killed behind its first checkpoint, and goes on.
def test_goes_on():
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "run"
        hours = 25 / 3600
        with subprocess.Popen([day.PROGRAM, "--quiet", "map", day.recording("stems", hours, 3), "-o", folder,
                               *day.ROWS["stems"][2], "--set", "run.checkpoint_interval_s=4"]) as begun:
            until = time.monotonic() + 200
            while not list(folder.glob(".understory/**/checkpoint*")) and time.monotonic() < until:
                check(begun.poll() is None, "the run ended before it was killed")
                time.sleep(0.1)
            os.kill(begun.pid, signal.SIGKILL)
        again = day.measured("stems", hours, 3, 2, folder)
        check(again["resumed"], "the run was begun anew")
        row = day.row_of("stems", hours, 3, again)
        check(f"| {json.loads((folder / 'run.json').read_text())['scans']} |" in row, f"the scans are not in {row}")
        once_more = day.measured("stems", hours, 3, 2, folder)
        check(not once_more["resumed"], "a finished run was resumed")


test_floors()
test_recording()
test_goes_on()
