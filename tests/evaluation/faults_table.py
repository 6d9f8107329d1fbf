"""The table of faults (benchmarks/faults.py). A wrong run that is called complete, or whose reason names
something else, misses the floor. Rows of another program do not count, and settings that a fault names
are those of sites."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "benchmarks"))

import faults  # noqa: E402

SNOW = next(f for f in faults.FAULTS if f.name == "heavy snow")


def check(condition, what):
    if not condition:
        sys.exit(f"faults_table: {what}")


def row(ape_m, status="complete", reasons=()):
    return {"ape_m": ape_m, "status": status, "reasons": list(reasons), "warnings": []}


def judged(ape_m, reference_m, **more):
    return faults.verdict(row(ape_m, **more), row(reference_m), SNOW)


def check_verdicts():
    check(judged(0.049, 0.001) == (0.05, "met", True), "5 cm are allowed whatever the undisturbed run has")
    check(judged(0.29, 0.1)[2] and not judged(0.31, 0.1)[2], "3 times the undisturbed run is the floor")
    check("complete" in judged(0.31, 0.1)[1], "a wrong run called complete is told as such")
    check(not judged(0.31, 0.1, status="complete", reasons=["snow"])[2], "a reason does not excuse `complete`")
    check(not judged(0.31, 0.1, status="partial", reasons=["the disk is full"])[2], "another reason is none")
    check(judged(0.31, 0.1, status="untrusted", reasons=["30 scans were not matched"])[2], "a fitting reason is")
    check(not judged(None, 0.1, status="failed", reasons=["no space"])[2], "a run without a path is judged too")


def check_resuming():
    folder = Path(tempfile.mkdtemp())
    rows = faults.Rows(folder)
    key = faults.key_of("lake", 3, 30, "heavy snow")
    rows.put({"key": key, **row(0.01)})
    check(key in faults.Rows(folder).rows and not faults.Rows(folder).lacks(key), "a row is there again")
    failed = faults.key_of("lake", 3, 30, "no IMU")
    rows.put({"key": failed, **row(None, status="failed")})
    check(faults.Rows(folder).lacks(failed), "a run that failed is tried again")
    text = rows.file.read_text()
    check(rows.version in text and rows.program in text, "it has the version and the program")
    rows.file.write_text(text.replace(rows.program, "another"))
    check(not faults.Rows(folder).rows, "a row of another program does not count")


def check_settings():
    for site in faults.SITES:
        for fault in faults.FAULTS:
            words = [w for k, v in faults.settings_of(fault, site, 30.0).items() for w in ("--set", f"{k}={v}")]
            done = subprocess.run([os.environ["UNDERSTORY_PROGRAM"], "simulate", site, "--print-site", *words],
                                  capture_output=True, text=True)
            check(done.returncode == 0, f"{site}, {fault.name}: {done.stderr}")
    noisy = faults.settings_of(next(f for f in faults.FAULTS if "noise" in f.name), "lohja1", 30.0)
    check(abs(noisy["imu.gyro_noise"] - 3.5e-3) < 1e-9, f"ten times the site's own noise: {noisy}")


if __name__ == "__main__":
    check_verdicts()
    check_resuming()
    check_settings()
