#!/usr/bin/env python3
"""`./run accuracy`: the accuracy table, from fresh runs of the program on simulated recordings.

  ./run accuracy                      the table with floors, seeds 21, 22, 23, then one of all sites, the
                                      first 3 minutes of each, seed 21; about an hour on two processors
  ./run accuracy --short              one short run a site, at most 5 minutes; what CI checks
  ./run accuracy --seeds 1 2          other seeds; 1 to 19 are those that settings are tuned on
  ./run accuracy --sites floors       the first of these tables; or parts of it: handheld,harvester,
                                      identity,kiss
  ./run accuracy --sites all          the second; or some of its rows: evo2,lake
  ./run accuracy --sites all --whole  from beginning to end
  ./run accuracy --spoilt             no table but 100 recordings spoilt so that the map is wrong beside 100
                                      good ones: is any wrong map called complete (see spoilt.py)
  ./run accuracy --write              puts the table, or the rows of the sites, into docs/method/results.md

Exit status 1 if a floor is missed (in the short form: by more than the stated margin).
"""

import argparse
import json
import shutil
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from program import (Failed, TOP, machine, map_recording, own_cpus, run, say, simulated, truth_of,
                     understory, understory_json, version)
from sites import SITES, measure_sites

PARTS = ("handheld", "harvester", "identity", "kiss")  # of the table with floors
LAST_TUNING_SEED = 19  # settings are tuned on seeds up to here, results are reported beyond
REPORTED_SEEDS = [21, 22, 23]
NO_LOOPS = "loop_closure.enabled=false"
# Files that hold times and memory; every other byte of a run folder must not depend on threads.
TIMED_FILES = {"run.json", "report.html"}
RESULTS = TOP / "docs" / "method" / "results.md"
BEGIN, END = "<!-- accuracy table: ./run accuracy --write -->", "<!-- end of accuracy table -->"


@dataclass
class Row:
    name: str
    unit: str
    floor: float
    short_margin: float  # the short form allows floor * margin (or, for shares found, floor / margin)
    at_least: bool = False
    decimals: int = 3


ROWS = {
    "handheld_drift": Row("handheld, no loop closure: drift", "%", 0.15, 1.5),
    "handheld_ape": Row("handheld, loop closure: APE RMSE (SE(3))", "cm", 5.0, 1.0, decimals=2),
    "harvester_drift": Row("harvester: drift", "%", 0.15, 1.5),
    "scan_mean": Row("whole pipeline per scan, mean", "ms", 45.0, 2.0, decimals=1),
    "scan_p99": Row("whole pipeline per scan, p99", "ms", 90.0, 2.0, decimals=1),
    # Of a lidar at 10 Hz. Other work of the machine shows here first, so the short form allows for it.
    "scan_max": Row("whole pipeline per scan, slowest", "ms", 100.0, 10.0, decimals=1),
    # In the short form the first tenth is almost all standing still.
    "constancy": Row("CPU per scan, last tenth / first tenth", "", 1.1, 2.0, decimals=2),
    "constancy_alone": Row("the same without loop closure", "", 1.1, 1.5, decimals=2),
    "kiss_ratio": Row("CPU per scan / KISS-ICP's", "", 2.0, 1.0, decimals=2),
    "memory": Row("peak memory", "MB", 1500.0, 1.0, decimals=0),
    "memory_growth": Row("memory at the end of the recording / at its half", "", 1.1, 1.0,
                         decimals=2),
    "recall": Row("stems found within 15 m (30 returns or more)", "%", 90.0, 1.1, True, 1),
    "false": Row("false stems within 15 m", "%", 5.0, 1.5, decimals=1),
    "identical": Row("files that differ between 1 and 2 threads", "", 0.0, 1.0, decimals=0),
}


class Table:
    """Measured values by row and seed."""

    def __init__(self):
        self.values = {}
        self.notes = []

    def add(self, row, seed, value):
        if value is None:
            self.notes.append(f"{ROWS[row].name}: not measured on seed {seed}")
            return
        self.values.setdefault(row, []).append((seed, value))
        say(f"    {ROWS[row].name}: {value:.{ROWS[row].decimals}f} {ROWS[row].unit}")


def passes(row, value, short):
    margin = row.short_margin if short else 1.0
    return value >= row.floor / margin if row.at_least else value <= row.floor * margin


def evaluate(folder, alignment):
    return understory_json("evaluate", folder, truth_of(folder), "--align", alignment)


def add_trees(table, seed, folder):
    truth = truth_of(folder)
    result = understory_json("evaluate", "trees", folder, truth, "--matching", "nearest", "--align", "yaw",
                             "--truth-returns", truth, "--path", truth, "--within-m", 15,
                             "--min-returns", 30)["visible"]
    table.add("recall", seed, 100.0 * result["recall"] if result["expected"] else None)
    table.add("false", seed, 100.0 * result["false_share"] if result["reported"] else None)


def add_cost(table, seed, result, short=False):
    scan = result["stages"]["scan"]
    table.add("scan_mean", seed, scan["wall_ms"]["mean"])
    table.add("scan_p99", seed, scan["wall_ms"]["p99"])
    table.add("scan_max", seed, scan["wall_ms"]["max"])
    table.add("memory", seed, result["process"]["peak_memory_mb"])
    add_constancy(table, "constancy", seed, result)
    if short:  # caches of bounded size are still filling
        return
    half, end = (result["quality"].get(f"memory_mb_{at}") for at in ("half", "end"))
    table.add("memory_growth", seed, end / half if half and end else None)


def add_constancy(table, row, seed, result):
    first, last = (result["quality"].get(f"scan_cpu_ms_{end}_tenth") for end in ("first", "last"))
    table.add(row, seed, last / first if first and last else None)


def note_trust(table, name, seed, result):
    if result["status"] != "complete":
        table.notes.append(f"{name}, seed {seed}: the run calls itself {result['status']}: "
                           + "; ".join(result.get("reasons", [])))


def mapped(table, folder, site, seed, settings=(), **keys):
    name = simulated(site, seed=seed, **keys)
    say(f"  {name} {' '.join(settings)}")
    result = map_recording(name, folder, threads=2, settings=settings)
    note_trust(table, site, seed, result)
    return result


def drift_percent(folder):
    return evaluate(folder, "first")["drift_percent"]


def measure_handheld(table, work, seed):
    folder = work / f"handheld_{seed}"
    result = mapped(table, folder, "handheld", seed)
    table.add("handheld_ape", seed, 100.0 * evaluate(folder, "se3")["ape_rmse_m"])
    add_cost(table, seed, result)
    add_trees(table, seed, folder)
    odometry = work / f"handheld_odometry_{seed}"
    alone = mapped(table, odometry, "handheld", seed, [NO_LOOPS, "map.enabled=false"])
    add_constancy(table, "constancy_alone", seed, alone)
    table.add("handheld_drift", seed, drift_percent(odometry))


def measure_harvester(table, work, seed, **keys):
    folder = work / f"harvester_{seed}"
    mapped(table, folder, "harvester", seed, [] if not keys else [NO_LOOPS], **keys)
    table.add("harvester_drift", seed, drift_percent(folder))


def measure_short(table, work, seed):
    folder = work / f"handheld_{seed}"
    result = mapped(table, folder, "handheld", seed, [NO_LOOPS], duration_s=45)
    table.add("handheld_drift", seed, drift_percent(folder))
    table.add("handheld_ape", seed, 100.0 * evaluate(folder, "se3")["ape_rmse_m"])
    add_cost(table, seed, result, short=True)
    add_trees(table, seed, folder)
    measure_harvester(table, work, seed, duration_s=60)


def differing_files(a, b):
    """Relative paths of files that one run has and the other has not, or that differ."""
    names = {p.relative_to(folder) for folder in (a, b) for p in folder.rglob("*") if p.is_file()}
    return sorted(str(name) for name in names
                  if name.name not in TIMED_FILES
                  and not ((a / name).exists() and (b / name).exists()
                           and (a / name).read_bytes() == (b / name).read_bytes()))


def measure_identity(table, work, seed, duration_s):
    """Every file the same bytes with one thread and with two, on both sites."""
    differing = []
    for site in ("handheld", "harvester"):
        name = simulated(site, seed=seed, duration_s=duration_s)
        folders = [work / f"identity_{site}_{threads}" for threads in (1, 2)]
        for threads, folder in zip((1, 2), folders):
            say(f"  {name} with {threads} thread{'s' if threads > 1 else ''}")
            map_recording(name, folder, threads=threads)
        differing += [f"{site}/{name}" for name in differing_files(*folders)]
    if differing:
        table.notes.append("differ between 1 and 2 threads: " + ", ".join(differing))
    table.add("identical", seed, float(len(differing)))


def measure_kiss(table, work, seed, duration_s):
    """CPU time beside KISS-ICP on the same scans, both pinned to the same two processors."""
    recording, cpus = work / "kiss.mcap", own_cpus()
    understory("simulate", "handheld", "-o", recording, "--overwrite", "--seed", seed, "--duration-s",
               duration_s)
    ours = map_recording(recording, work / "kiss_run", threads=2, cpus=cpus)
    summary = work / "kiss.json"
    peer = run(sys.executable, TOP / "benchmarks" / "peers" / "kiss_icp_peer.py", recording,
               work / "kiss.tum", summary, 2, cpus=cpus)
    if peer.code != 0:
        table.notes.append("KISS-ICP could not be run: " + peer.stderr.strip()[-200:])
        return

    kiss = json.loads(summary.read_text())
    cpu = ours["stages"]["scan"]["cpu_ms"]["mean"]
    table.notes.append(f"CPU a scan on {kiss['scans']} scans of seed {seed}: {cpu:.0f} ms in the "
                       f"pipeline ({1e3 * ours['process']['cpu_s'] / kiss['scans']:.0f} ms with "
                       f"reading, map, trees and report), KISS-ICP {kiss['version']} "
                       f"{kiss['cpu_ms']['mean']:.0f} ms")
    table.add("kiss_ratio", seed, cpu / kiss["cpu_ms"]["mean"])


def render(table, short, seconds):
    lines = [f"{version()}, {time.strftime('%Y-%m-%d')}, {machine()}; "
             f"{'short form, ' if short else ''}{seconds / 60:.0f} minutes.", "",
             "| | unit | floor | " + ("allowed here | " if short else "")
             + "measured (seed) | |", "|---|---|---|" + ("---|" if short else "") + "---|---|"]
    missed = []
    for key, row in ROWS.items():
        values = table.values.get(key)
        sign = "≥" if row.at_least else "≤"
        number = f"{{:.{row.decimals}f}}".format
        cells = [row.name, row.unit, f"{sign} {row.floor:g}"]
        if short:
            allowed = row.floor / row.short_margin if row.at_least else row.floor * row.short_margin
            cells.append(f"{sign} {allowed:.3g}")
        if not values:
            cells += ["not measured", ""]
        else:
            tuned = [s for s, _ in values if s <= LAST_TUNING_SEED]
            cells.append(", ".join(f"{number(v)} ({s}{'*' if s in tuned else ''})"
                                   for s, v in values))
            good = all(passes(row, v, short) for _, v in values)
            cells.append("met" if good else "missed")
            if not good:
                missed.append(row.name)
        lines.append("| " + " | ".join(cells) + " |")
    if any(s <= LAST_TUNING_SEED for v in table.values.values() for s, _ in v):
        lines += ["", f"\\* settings are tuned on seeds up to {LAST_TUNING_SEED}: not a result."]
    lines += [""] + [f"- {note}" for note in table.notes]
    return "\n".join(lines).rstrip() + "\n", missed


def write_results(text):
    page = RESULTS.read_text() if RESULTS.exists() else f"# Results\n\n{BEGIN}\n{END}\n"
    head, rest = page.split(BEGIN, 1)
    _, tail = rest.split(END, 1)
    RESULTS.write_text(f"{head}{BEGIN}\n{text}{END}{tail}")
    say(f"written into {RESULTS}")


def site_names(text):
    groups = {"all": SITES, "floors": PARTS}
    names = [name for word in text.split(",") for name in groups.get(word, [word])]
    unknown = [name for name in names if name not in SITES and name not in PARTS]
    if unknown:
        raise argparse.ArgumentTypeError(f"unknown: {', '.join(unknown)}")
    return names


def arguments():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--seeds", type=int, nargs="+")
    parser.add_argument("--sites", type=site_names, default="floors,all", metavar="A,B",
                        help=f"of {', '.join(['floors', 'all', *PARTS, *SITES])}")
    parser.add_argument("--whole", action="store_true", help="whole sites, not their first minutes")
    parser.add_argument("--write", action="store_true", help="put the table into docs/method/results.md")
    parser.add_argument("--keep", type=Path, help="keep the run folders here")
    parser.add_argument("--spoilt", action="store_true", help="spoilt recordings beside good ones")
    parser.add_argument("--wanted", type=int, default=100, metavar="N",
                        help="with --spoilt: so many wrong maps and so many good ones")
    parser.add_argument("--way", default="",
                        help="with --spoilt: only ways of spoiling with this in their names")
    parser.add_argument("--fit", action="store_true",
                        help="with --spoilt --keep: only what good and wrong runs there are like")
    return parser.parse_args()


def measure(table, work, options):
    if options.short:
        seed = (options.seeds or REPORTED_SEEDS)[0]
        measure_short(table, work, seed)
        measure_identity(table, work, seed, duration_s=8)
        return
    seeds = options.seeds or REPORTED_SEEDS
    for seed in seeds:
        if "handheld" in options.sites:
            measure_handheld(table, work, seed)
        if "harvester" in options.sites:
            measure_harvester(table, work, seed)
    if "identity" in options.sites:
        measure_identity(table, work, seeds[0], duration_s=30)
    if "kiss" in options.sites:
        measure_kiss(table, work, seeds[0], duration_s=20)


def main():
    options = arguments()
    papers = [site for site in options.sites if site in SITES]
    floors = options.short or any(site in PARTS for site in options.sites)
    work = options.keep or Path(tempfile.mkdtemp(prefix="understory-accuracy-"))
    work.mkdir(parents=True, exist_ok=True)
    if options.spoilt:
        from spoilt import measure_spoilt_runs
        good = measure_spoilt_runs(work, options.seeds, options.wanted, options.write, options.fit,
                                   options.way)
        return 0 if good else 1
    table, begin, failure, ran = Table(), time.perf_counter(), None, True
    try:
        if floors:
            measure(table, work, options)
            if options.write:  # before the sites, which take longer
                write_results(render(table, options.short, time.perf_counter() - begin)[0])
        if papers and not options.short:
            ran = measure_sites(work, papers, options.seeds or REPORTED_SEEDS[:1], options.whole,
                                options.write)
    except Failed as error:
        failure = str(error)
        table.notes.append(failure.replace("\n", " "))
    finally:
        if not options.keep:
            shutil.rmtree(work, ignore_errors=True)
    if not floors:
        return 0 if ran and not failure else 1
    text, missed = render(table, options.short, time.perf_counter() - begin)
    print(text)
    for name in missed:
        say(f"floor missed: {name}")
    if failure:
        say(f"failed: {failure}")
        if options.write:
            write_results(text)
    return 1 if missed or failure or not ran else 0


if __name__ == "__main__":
    sys.exit(main())
