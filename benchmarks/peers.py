#!/usr/bin/env python3
"""`./run bench peers`: the field's systems and this one on the same recordings, site by site.

  ./run bench peers                               60 s of handheld and harvester, seed 21
  ./run bench peers --sites handheld --duration-s 180 --seed 22
  ./run bench peers --only DLIO KissICP           some of them
  ./run bench peers --write                       puts each table into docs/method/results.md when it is done

From PyPI, into one common environment: evalio (LIO-SAM, DLIO, LOAM, KISS-ICP, GenZ-ICP, CT-ICP, MAD-ICP,
FORM) and RKO-LIO. Each in one of its own: SE3-LIO, GenZ-LIO, Pelorus, Super-LIO, Retro-SLAM. One after
another, two threads, pinned to the same two processors. Errors are against the recording's truth; CPU
and wall time a scan are without reading.
"""

import argparse
import json
import re
import sys
import tempfile
import time
from pathlib import Path

from program import (Failed, TOP, machine, map_recording, own_cpus, run, say, understory,
                     understory_json, version)
from sites import SITES

PEERS = TOP / "benchmarks" / "peers"
RESULTS = TOP / "docs" / "method" / "results.md"
BEGIN, END = "<!-- peers table: ./run bench peers --write -->", "<!-- end of peers table -->"
# DLIO and LIO-SAM work in threads of their own and are fed at the sensor's rate.
EVALIO = {"LioSAM": 1.0, "DLIO": 1.0, "LOAM": 0, "KissICP": 0, "GenZICP": 0, "CTICP": 0,
          "MadICP": 0, "FORM": 0}
# Each in an environment of its own, as they pin versions that clash: its list of packages in
# benchmarks/peers/newcomers. Those under the GPL are programs of their own, as all are.
NEWCOMERS = {"SE3-LIO": "se3-lio", "GenZ-LIO": "genz-lio", "Pelorus": "pelorus", "Super-LIO": "super-lio",
             "Retro-SLAM": "retro-slam"}
# (understory where the site has one)
WITH_IMU = {"understory", "LioSAM", "DLIO", "RKO-LIO", "SE3-LIO", "GenZ-LIO", "Pelorus", "Super-LIO"}


def ours(recording, work, cpus, name, settings, more=()):
    if "sparse" not in more:
        settings = ["map.enabled=false", *settings]
    result = map_recording(recording, work / name, threads=2, cpus=cpus, settings=settings,
                           more=more)
    scan = result["stages"]["scan"]
    return {"name": name, "version": version().split()[-1], "scans": result["scans"],
            "answered": result["poses"] / max(1, result["scans"]), "cpu_ms": scan["cpu_ms"],
            "wall_ms": scan["wall_ms"], "peak_memory_mb": result["process"]["peak_memory_mb"],
            "trajectory": work / name / "trajectory.tum"}


def interpreter(name):
    """Of the environment that holds a peer; made where it is missing."""
    if name not in NEWCOMERS:
        return sys.executable
    made = run(TOP / "tools" / "python-env.sh", f"benchmarks/peers/newcomers/{NEWCOMERS[name]}.txt")
    if made.code != 0:
        raise Failed(made.stderr.strip() or "no environment for it")
    return made.stdout.strip().splitlines()[-1]


def peer(name, recording, work, cpus):
    trajectory, summary = work / f"{name}.tum", work / f"{name}.json"
    more = []
    if name in EVALIO:
        script, more = "evalio_peer", [name, EVALIO[name]]
    elif name in NEWCOMERS:
        script = NEWCOMERS[name].replace("-", "_") + "_peer"
    else:
        script = "rko_lio_peer"
    try:
        python = interpreter(name)
    except Failed as error:
        return {"name": name, "failed": str(error).splitlines()[-1][:120]}
    done = run(python, PEERS / f"{script}.py", recording, trajectory, summary, 2, *more, cpus=cpus)
    if done.code != 0:
        reason = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return {"name": name, "failed": f"ended with {done.code}: {reason[:120]}"}
    return {**json.loads(summary.read_text()), "name": name, "trajectory": trajectory}


def add_errors(result, truth):
    if "failed" in result:
        return result
    try:
        aligned = understory_json("evaluate", result["trajectory"], truth, "--align", "se3")
        first = understory_json("evaluate", result["trajectory"], truth, "--align", "first")
    except Failed as error:
        return {**result, "failed": str(error).strip().splitlines()[-1][:120]}
    segments = [s["translation_percent"] for s in first.get("segments", [])]
    return {**result, "ape_cm": 100.0 * aligned["ape_rmse_m"], "drift": first["drift_percent"],
            "segments": sum(segments) / len(segments) if segments else None}


def cell(value, decimals):
    return "" if value is None else f"{value:.{decimals}f}"


def has_imu(site_yaml):
    """Whether the site whose settings these are has an IMU."""
    return not re.search(r"^imu:\n(?:  .*\n)*?  enabled: false$", site_yaml, re.MULTILINE)


def render(results, what, inertial=True):
    lines = [f"**{what}** ({version()}, {time.strftime('%Y-%m-%d')}, {machine()})", "",
             "| | IMU | APE SE(3) cm | drift % | segments % | scans answered % | CPU ms a scan "
             "| wall ms mean | p99 | memory MB |", "|---|---|---|---|---|---|---|---|---|---|"]
    for r in results:
        imu = "yes" if inertial and r["name"] in WITH_IMU else "no"
        if "failed" in r:
            lines.append(f"| {r['name']} | {imu} | failed: {r['failed']} | | | | | | | |")
            continue
        wall = r.get("wall_ms") or {}
        lines.append("| " + " | ".join([
            f"{r['name']} ({r['version']})", imu, cell(r["ape_cm"], 1), cell(r["drift"], 2),
            cell(r["segments"], 2), cell(100.0 * r["answered"], 0), cell(r["cpu_ms"]["mean"], 0),
            cell(wall.get("mean"), 0), cell(wall.get("p99"), 0),
            cell(r["peak_memory_mb"], 0)]) + " |")
    return "\n".join(lines) + "\n"


def cpu_of(result):
    return {"CPU ms a scan": result["cpu_ms"]["mean"]} if "cpu_ms" in result else {}


def as_point_clouds(recording, truth):
    """The recording that peers read: PointCloud2. A simulated Livox writes its driver's own messages."""
    if "Mid-360" not in (truth / "site.yaml").read_text():
        return recording
    plain = recording.with_name(f"{recording.stem}_clouds.mcap")
    understory("convert", recording, plain, "--overwrite")
    return plain


def measure(site, options, work):
    what = f"{site}, seed {options.seed}, {options.duration_s:g} s"
    recording = work / f"{site}.mcap"
    say(f"  simulating {what}")
    understory("simulate", site, "-o", recording, "--overwrite", "--seed", options.seed, "--duration-s",
               options.duration_s)
    cpus, truth, results = own_cpus(), recording.with_suffix(".truth"), []
    plain = as_point_clouds(recording, truth)
    jobs = {"understory": lambda: ours(recording, work, cpus, "understory", []),
            "understory, no IMU, no loops": lambda: ours(
                recording, work, cpus, "understory, no IMU, no loops",
                ["motion.imu_enabled=false", "loop_closure.enabled=false"])}
    for name in [*EVALIO, "RKO-LIO", *NEWCOMERS]:
        jobs[name] = lambda name=name: peer(name, plain, work, cpus)
    inertial = has_imu((truth / "site.yaml").read_text())
    if not inertial:
        del jobs["understory, no IMU, no loops"]
        jobs["understory, stems alone"] = lambda: ours(
            recording, work, cpus, "understory, stems alone", [], ["--front-end", "sparse"])
        jobs = {name: jobs[name] for name in sorted(jobs, key=lambda name: not name.startswith("under"))
                if name not in WITH_IMU or name == "understory"}
    for name, job in jobs.items():
        if options.only and name not in options.only:
            continue
        say(f"  {name}")
        results.append(add_errors(job(), truth))
        say("    " + ", ".join(f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}"
                               for k, v in {**results[-1], **cpu_of(results[-1])}.items()
                               if k in ("failed", "ape_cm", "drift", "answered", "CPU ms a scan")))
    for written in {recording, plain}:
        written.unlink()
    return render(results, what, inertial)


def parts_of(text):
    """The tables of a record by what they are of: site, seed and length."""
    starts = [m.start() for m in re.finditer(r"^\*\*", text, re.MULTILINE)] + [len(text)]
    parts = {}
    for begin, end in zip(starts, starts[1:]):
        part = text[begin:end].strip()
        parts[part[2:part.index("**", 2)]] = part + "\n"
    return parts


def place_of(what):
    """Where a table belongs: sites as listed, others after them, then by seed and length."""
    site, seed, length = what.split(", ")
    order = ["handheld", "harvester", *SITES]
    return (order.index(site) if site in order else len(order), site, int(seed.split()[1]),
            float(length.split()[0]))


def rows_of(part):
    """The cells of a table's rows that have an error, by name without version."""
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in part.splitlines()
            if line.startswith("| ") and not line.startswith("| |")]
    return {row[0].split(" (")[0]: row for row in rows if row[2].strip("0123456789.") == ""}


def summary(parts):
    """One line a table: this program beside the best of the others, as far as they ran."""
    lines = ["| site | this: APE cm | best other: APE cm | this: CPU ms a scan "
             "| least of the others with IMU: CPU ms |", "|---|---|---|---|---|"]
    for what in sorted(parts, key=place_of):
        rows = rows_of(parts[what])
        own = rows.get("understory")
        others = {name: row for name, row in rows.items() if not name.startswith("understory")}
        if own is None or not others:
            continue
        best = min(others, key=lambda name: float(others[name][2]))
        inertial = {n: float(row[6]) for n, row in others.items() if n in WITH_IMU and row[6]}
        least = min(inertial, key=inertial.get, default=None)
        cheapest = f"{inertial[least]:.0f} ({least})" if least else ""
        lines.append(f"| {what} | {own[2]} | {others[best][2]} ({best}) | {own[6]} | {cheapest} |")
    return "\n".join(lines) + "\n"


def write_results(text, page=RESULTS):
    """Puts tables into the record in place of those of the same site, seed and length."""
    head, rest = page.read_text().split(BEGIN, 1)
    old, tail = rest.split(END, 1)
    parts = {**parts_of(old), **parts_of(text)}
    tables = "\n".join(parts[what] for what in sorted(parts, key=place_of))
    page.write_text(f"{head}{BEGIN}\n{summary(parts)}\n{tables}{END}{tail}")
    say(f"written into {page}")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", nargs="+", default=["handheld", "harvester"])
    parser.add_argument("--seed", type=int, default=21)
    parser.add_argument("--duration-s", type=float, default=60.0)
    parser.add_argument("--only", nargs="+", help="names as in the table")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="understory-peers-") as scratch:
        for site in options.sites:
            text = measure(site, options, Path(scratch))
            print(text, flush=True)
            if options.write:
                write_results(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
