"""The table of all sites: the whole program on the papers' sites, a row each (`./run accuracy --sites`)."""

import re
import time

from program import (Failed, TOP, machine, map_recording, say, simulated, truth_of, understory_json,
                     version)

EXCERPT_S = 180
# How a site is mapped. By stems alone: the harvesters without an IMU. With the machine's boxes: where
# the scanner looks all round and sees its own cabin.
WAYS = {
    "": [],
    "by stems": ["--front-end", "sparse"],
    "machine boxes": ["--set", "preprocess.machine_boxes_file="
                      + str(TOP / "benchmarks" / "harvester_boxes.yaml")],
}
# In the order of the table.
SITES = ["evo1", "evo2", "evo3", "tuusniemi1", "tuusniemi3", "lieksa1", "lieksa2", "lieksa3",
         "lohja1", "lohja2", "hover", "swing", "lake", "forest", "skidoo", "mid360",
         "demo"]
OTHER_WAYS = {"lieksa1": "by stems", "lieksa2": "by stems", "lieksa3": "by stems",
              "tuusniemi1": "machine boxes", "tuusniemi3": "machine boxes"}
RESULTS = TOP / "docs" / "method" / "results.md"
BEGIN = "<!-- sites table: ./run accuracy --sites all --write -->"
END = "<!-- end of sites table -->"
HEAD = ("| site | seed | part | way m | APE SE(3) cm | drift % | stems to be seen | found % | false % "
        "| CPU ms a scan | scan 99 % ms | memory MB | status | measured |")


def row_names(sites):
    """(site, way) of every row that these sites give, in the order of the table."""
    rows = []
    for site in SITES:
        if site in sites:
            rows.append((site, ""))
            if site in OTHER_WAYS:
                rows.append((site, OTHER_WAYS[site]))
    return rows


def number(value, decimals, scale=1.0):
    return "" if value is None else f"{scale * value:.{decimals}f}"


def tree_cells(folder):
    truth = truth_of(folder)
    seen = understory_json("evaluate", "trees", folder, truth, "--matching", "nearest", "--align", "yaw", "--truth-returns",
                           truth, "--path", truth, "--within-m", 15, "--min-returns",
                           30)["visible"]
    return [str(seen["expected"]),
            number(seen["recall"], 1, 100.0) if seen["expected"] else "",
            number(seen["false_share"], 1, 100.0) if seen["reported"] else ""]


def measure_row(work, site, way, seed, whole):
    """The cells of one row; a run that fails gives a row that says so."""
    keys = {"seed": seed} if whole or site == "demo" else {"seed": seed, "duration_s": EXCERPT_S}
    recording = simulated(site, **keys)
    folder = work / f"{site}_{way.replace(' ', '_')}_{seed}"
    say(f"  {recording} {way}")
    name = f"{site}, {way}" if way else site
    part = f"first {EXCERPT_S} s" if "duration_s" in keys else "whole"
    measured = (f"{version()}, {time.strftime('%Y-%m-%d')}, load "
                f"{machine().rsplit('load ', 1)[1]}")
    try:
        result = map_recording(recording, folder, more=WAYS[way])
        errors = understory_json("evaluate", folder, truth_of(folder), "--align", "se3")
        trees = tree_cells(folder)
    except Failed as error:
        reason = str(error).splitlines()[-1].replace("|", "/")
        return [name, str(seed), part] + [""] * 9 + [reason, measured]
    scan = result["stages"].get("scan", {})
    reasons = "; ".join(result.get("reasons", [])).replace("|", "/")
    return [name, str(seed), part, number(errors["length_m"], 0),
            number(errors["ape_rmse_m"], 1, 100.0), number(errors["drift_percent"], 3), *trees,
            number(scan.get("cpu_ms", {}).get("mean"), 1),
            number(scan.get("wall_ms", {}).get("p99"), 0),
            number(result["process"]["peak_memory_mb"], 0),
            result["status"] + (f": {reasons}" if reasons else ""), measured]


def key_of(cells):
    return tuple(cells[:3])


def place_of(cells):
    """Where a row belongs: sites as listed, then by way and seed; excerpts first."""
    site, _, way = cells[0].partition(", ")
    return (SITES.index(site) if site in SITES else len(SITES), way, int(cells[1]),
            cells[2] == "whole")


def rows_of(text):
    """The rows that a table holds."""
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines
            if not line.startswith("| site |")]


def render(rows):
    rows = sorted(rows, key=place_of)
    rule = "|" + "---|" * (HEAD.count("|") - 1)
    return "\n".join([HEAD, rule, *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"


def merged(old, new):
    """The record with the new rows in place of those of the same site, seed and part."""
    keys = {key_of(row) for row in new}
    return [row for row in old if key_of(row) not in keys] + new


def write_row(row, page=RESULTS):
    text = page.read_text()
    head, rest = text.split(BEGIN, 1)
    table, tail = rest.split(END, 1)
    page.write_text(f"{head}{BEGIN}\n{render(merged(rows_of(table), [row]))}{END}{tail}")


def measure_sites(work, sites, seeds, whole, write):
    """Rows of all sites; each goes into the record as soon as it is known. True if all ran."""
    rows = []
    for seed in seeds:
        for site, way in row_names(sites):
            row = measure_row(work, site, way, seed, whole)
            say("    " + " | ".join(row))
            rows.append(row)
            if write:
                write_row(row)
    print(render(rows))
    return all(row[3] for row in rows)
