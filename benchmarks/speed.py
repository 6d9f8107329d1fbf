#!/usr/bin/env python3
"""`./run bench`: CPU time per scan beside KISS-ICP and small_gicp (PyPI).

  ./run bench                        20 s of the handheld site, 3 rounds
  ./run bench --recording REC.mcap   another recording in this project's MCAP form
  ./run bench peers                  accuracy beside many more: benchmarks/peers.py
  ./run bench --write                puts the table into docs/method/results.md

All take the same scans on the same two processors, in turn, round after round. Whatever else the machine
does then falls on all of them. Ratios are made within a round, and their median is given. Accuracy is
against the recording's truth (REC.truth), aligned by SE(3).
"""

import argparse
import json
import statistics
import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

from program import (TOP, machine, map_recording, own_cpus, run, say, understory, understory_json,
                     version)

PEERS = TOP / "benchmarks" / "peers"
RESULTS = TOP / "docs" / "method" / "results.md"
BEGIN, END = "<!-- speed table: ./run bench --write -->", "<!-- end of speed table -->"


def measure_understory(recording, work, cpus):
    result = map_recording(recording, work / "run", threads=2, cpus=cpus)
    scan = result["stages"]["scan"]
    return {"name": "understory", "version": version().split()[-1], "scans": result["scans"],
            "cpu_ms": scan["cpu_ms"], "wall_ms": scan["wall_ms"],
            "whole_cpu_ms": 1e3 * result["process"]["cpu_s"] / result["scans"],
            "peak_memory_mb": result["process"]["peak_memory_mb"],
            "trajectory": str(work / "run" / "trajectory.tum")}


def measure_peer(script, recording, work, cpus):
    trajectory, summary = work / f"{script}.tum", work / f"{script}.json"
    done = run(sys.executable, PEERS / f"{script}.py", recording, trajectory, summary, 2, cpus=cpus)
    if done.code != 0:
        say(f"  {script} ended with {done.code}: {done.stderr.strip()[-400:]}")
        return None
    return {**json.loads(summary.read_text()), "trajectory": str(trajectory)}


def accuracy(result, truth):
    if not truth.exists():
        return None
    errors = understory_json("evaluate", result["trajectory"], truth, "--align", "se3")
    return {"ape_cm": 100.0 * errors["ape_rmse_m"], "drift_percent": errors["drift_percent"],
            "pairs": errors["pairs"]}


def available():
    peers = {"kiss_icp": "kiss_icp_peer", "small_gicp": "small_gicp_peer"}
    for module in list(peers):
        if find_spec(module) is None:
            say(f"the Python package {module} is not installed: left out")
            del peers[module]
    return list(peers.values())


def measure(recording, options, work):
    """Rounds of results by name."""
    cpus, peers, rounds = own_cpus(), available(), []
    for k in range(options.rounds):
        results = {}
        for script in [None, *peers]:
            say(f"  round {k + 1} of {options.rounds}: {script or 'understory'}")
            result = (measure_peer(script, recording, work, cpus) if script
                      else measure_understory(recording, work, cpus))
            if result is None:
                continue
            result["accuracy"] = accuracy(result, recording.with_suffix(".truth"))
            results[result["name"]] = result
        rounds.append(results)
    return rounds


def cell(value, decimals):
    return "" if value is None else f"{value:.{decimals}f}"


def render(rounds, what):
    names = list(dict.fromkeys(name for results in rounds for name in results))
    lines = [f"{version()}, {time.strftime('%Y-%m-%d')}, {machine()}; {what}; two threads, "
             f"{len(rounds)} round{'s' if len(rounds) > 1 else ''}.", "",
             "| | CPU ms a scan (rounds) | understory / it | wall ms mean | p99 | memory MB "
             "| APE SE(3) cm | drift % |", "|---|---|---|---|---|---|---|---|"]
    for name in names:
        series = [r[name] for r in rounds if name in r]
        ratios = [r["understory"]["cpu_ms"]["mean"] / r[name]["cpu_ms"]["mean"]
                  for r in rounds if name in r]
        last = series[-1]
        errors, wall = last.get("accuracy") or {}, last.get("wall_ms") or {}
        lines.append("| " + " | ".join([
            f"{name} {last['version']}",
            " / ".join(f"{s['cpu_ms']['mean']:.0f}" for s in series),
            f"{statistics.median(ratios):.2f}", cell(wall.get("mean"), 0), cell(wall.get("p99"), 0),
            cell(last.get("peak_memory_mb"), 0), cell(errors.get("ape_cm"), 1),
            cell(errors.get("drift_percent"), 2)]) + " |")
    whole = statistics.median(r["understory"]["whole_cpu_ms"] for r in rounds)
    lines += ["", f"- The whole of `understory map` (reading, decoding, map, trees and report "
              f"included) takes {whole:.0f} ms of CPU a scan.",
              "- The peers' figures leave their reading out, and so does the row of this program."]
    return "\n".join(lines) + "\n"


def write_results(text):
    page = RESULTS.read_text()
    head, rest = page.split(BEGIN, 1)
    _, tail = rest.split(END, 1)
    RESULTS.write_text(f"{head}{BEGIN}\n{text}{END}{tail}")
    say(f"written into {RESULTS}")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recording", type=Path)
    parser.add_argument("--site", default="handheld")
    parser.add_argument("--seed", type=int, default=21)
    parser.add_argument("--duration-s", type=float, default=20.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="understory-bench-") as scratch:
        work = Path(scratch)
        recording, what = options.recording, str(options.recording)
        if recording is None:
            recording = work / "bench.mcap"
            what = f"{options.site}, seed {options.seed}, {options.duration_s:g} s"
            say(f"  simulating {what}")
            understory("simulate", options.site, "-o", recording, "--overwrite", "--seed", options.seed,
                       "--duration-s", options.duration_s)
        text = render(measure(recording, options, work), what)
    print(text)
    if options.write:
        write_results(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
