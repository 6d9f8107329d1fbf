#!/usr/bin/env python3
"""Whether the online georeference states its errors honestly at every scan: one path a site, many receivers on it.

    ./run bench online [--runs FOLDER] [--seeds FROM TO] [--sites SITE...] [--write]

FOLDER holds a run for each site (FOLDER/evo1 ...), mapped with `understory map "sim:evo1?seed=1"`. Without a run a
site's true path with a realistic drift stands in. Seeds up to 19 are those that its numbers are tuned on, results are
reported from 41 on. --write puts the table into docs/method/georeference.md. Exit status 1 if a floor is missed."""
import argparse
import csv
import io
import math
import pathlib
import subprocess
import sys

TOP = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = TOP / "build" / "benchmarks" / "online_georeference"
PAGE = TOP / "docs" / "method" / "georeference.md"
BEGIN, END = "<!-- online georeference -->", "<!-- end of online georeference -->"
SITES = ("evo1", "evo2", "tuusniemi1", "tuusniemi3")
FREEDOMS = {"east": "east", "north": "north", "up": "up", "turn_east": "turn east", "turn_north": "turn north",
            "turn_up": "heading"}
WITHIN_PERCENT = 99.0  # of the scans, within three stated standard deviations
CPU_MS = 1.0           # a scan


def measure(site, path, seeds, settings):
    command = [PROGRAM, site, path, *map(str, seeds), f"gnss_preset=faitli_{site}", "gnss.rate_hz=2", *settings]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(io.StringIO(done.stdout))]


def total(rows, key):
    return sum(row[key] for row in rows)


def percent(rows, freedom):
    return 100.0 * total(rows, f"{freedom}_within") / total(rows, f"{freedom}_known")


def cells(rows):
    """Of each degree of freedom: share within three standard deviations, error and stated error (root mean squares)."""
    for freedom in FREEDOMS:
        known = total(rows, f"{freedom}_known")
        error, stated = (math.sqrt(total(rows, f"{freedom}_{what}") / known) for what in ("squares", "variance"))
        yield f"{percent(rows, freedom):.1f} %, {error:.2f} ({stated:.2f})"


def table(results):
    lines = ["| receiver | " + " | ".join(FREEDOMS.values()) + " | CPU ms a scan |", "|---" * 8 + "|"]
    for site, rows in results.items():
        lines.append(f"| {site} | " + " | ".join(cells(rows)) + f" | {total(rows, 'cpu_ms') / len(rows):.3f} |")
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=pathlib.Path, default=pathlib.Path("no runs"))
    parser.add_argument("--seeds", type=int, nargs=2, default=(1, 19))
    parser.add_argument("--sites", nargs="*", default=SITES)
    parser.add_argument("--set", nargs="*", default=[])
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    results = {}
    for site in arguments.sites:
        run = arguments.runs / site
        path = str(run) if (run / "trajectory.tum").exists() else "drift:1"
        results[site] = measure(site, path, arguments.seeds, arguments.set)
    pooled = [row for rows in results.values() for row in rows]
    lines = table({**results, "all": pooled})
    print("\n".join(lines))
    if arguments.write:
        text = PAGE.read_text()
        head = f"Receivers of the seeds {arguments.seeds[0]} to {arguments.seeds[1]}."
        begin, end = text.index(BEGIN) + len(BEGIN), text.index(END)
        PAGE.write_text(text[:begin] + "\n" + "\n".join([head, "", *lines]) + "\n" + text[end:])
    missed = [f"{name}: {percent(pooled, freedom):.2f} %" for freedom, name in FREEDOMS.items()
              if percent(pooled, freedom) < WITHIN_PERCENT]
    if total(pooled, "cpu_ms") / len(pooled) > CPU_MS:
        missed.append(f"{total(pooled, 'cpu_ms') / len(pooled):.2f} ms of CPU a scan")
    print("\n".join(f"MISSED {one}" for one in missed))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
