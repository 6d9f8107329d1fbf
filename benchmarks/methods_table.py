"""Tables 3 and 4 of P4 for every method of matching on simulated sites, without loop closure.

    methods_table.py [--sites evo1,tuusniemi1] [--methods ndt,gicp] [--seed 42] [--seconds 30] [--folder KEEP]
                                                                        ./run bench methods

Each site is simulated once, and each method maps that recording. Drift is the error at the end of the
path when both paths begin at the truth. It is in metres (Table 3) and as a share of the way (Table 4).
`--seconds 0` takes whole sites. A run that is in the folder already is not made again, so that a long
table can go on.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from program import DONE, UNTRUSTED, PROGRAM, Failed, machine, say, understory, understory_json, version

SITES = ("evo1", "evo2", "evo3", "tuusniemi1", "tuusniemi3")
METHODS = ("ndt", "gicp", "vgicp", "loam", "loam_ground", "ndt_d2d", "icp", "point_to_gaussian", "gaussian_to_gaussian")
# Drift as a share of the way, P4 Table 4.
PAPER = {"ndt": (0.01870, 0.00224, 0.01781, 0.00191, 0.00640),
         "gicp": (6.40896, 0.03309, 0.12640, 0.00323, 0.10893)}


def recording_of(site, seed, seconds, folder):
    recording = folder / f"{site}_{seed}_{seconds}.mcap"
    if not recording.exists():
        begun = folder / f"begun_{recording.name}"
        length = ["--duration-s", seconds] if seconds else []
        understory("simulate", site, "-o", begun, "--seed", seed, *length, "--overwrite")
        begun.with_suffix(".truth").rename(recording.with_suffix(".truth"))
        begun.rename(recording)
    return recording


def mapped(recording, method, limit_s):
    """The folder of the run, or None if it took too long or failed."""
    run = recording.parent / f"{recording.stem}_{method}"
    if not (run / "run.json").exists():
        settings = [f"registration.method={method}", "loop_closure.enabled=false", "map.enabled=false"]
        arguments = [PROGRAM, "--quiet", "map", recording, "-o", run, "--threads", "1", "--overwrite"]
        for setting in settings:
            arguments += ["--set", setting]
        done = subprocess.run([str(a) for a in arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                              text=True, timeout=limit_s)
        if done.returncode not in (DONE, UNTRUSTED):
            raise Failed(done.stderr.strip()[-300:])
    return run


def row_of(site, method, recording, limit_s):
    run = mapped(recording, method, limit_s)
    told = json.loads((run / "run.json").read_text())
    error = understory_json("evaluate", run, recording.with_suffix(".truth"), "--align", "se3")
    stages = told["stages"]
    row = {"site": site, "method": method, "way_m": error["length_m"], "drift_m": error["drift_end_m"],
           "drift_percent": error["drift_percent"], "ape_m": error["ape_rmse_m"],
           "match_ms": stages["matching"]["cpu_ms"]["mean"], "scan_ms": stages["scan"]["cpu_ms"]["mean"]}
    if method in PAPER and site in SITES:
        row["paper_over_ours"] = 100 * PAPER[method][SITES.index(site)] / max(row["drift_percent"], 1e-6)
    return row


def print_row(row):
    less = f"{row['paper_over_ours']:.0f} times" if "paper_over_ours" in row else ""
    print(f"| {row['site']} | {row['way_m']:.0f} | `{row['method']}` | {row['drift_m']:.3f} | {row['drift_percent']:.3f} "
          f"| {100 * row['ape_m']:.1f} | {row['match_ms']:.1f}, {row['scan_ms']:.0f} | {less} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sites", default=",".join(SITES))
    parser.add_argument("--methods", default=",".join(METHODS))
    parser.add_argument("--seed", type=int, default=42)
    parser.add_argument("--seconds", type=int, default=30, help="0: whole sites")
    parser.add_argument("--folder", type=Path, help="where recordings and runs are kept")
    parser.add_argument("--limit-s", type=float, help="a method that takes longer is left out")
    options = parser.parse_args()
    print(f"version {version()}, {machine()}, seed {options.seed}, "
          f"{f'first {options.seconds} s' if options.seconds else 'whole sites'}\n")
    print("| site | way m | method | drift m | drift % | APE cm | a match, a scan ms | the paper's drift over it |")
    print("|---|---|---|---|---|---|---|---|", flush=True)
    missed = 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.folder or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        for method in options.methods.split(","):
            for site in options.sites.split(","):
                try:
                    recording = recording_of(site, options.seed, options.seconds, folder)
                    print_row(row_of(site, method, recording, options.limit_s))
                except (Failed, subprocess.TimeoutExpired) as failure:
                    missed += 1
                    say(f"{site}, {method}: {failure}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
