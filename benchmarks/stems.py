#!/usr/bin/env python3
"""`./run bench stems`: maps of stems that correct themselves, and the stems of a real forest.

  ./run bench stems                 ten seeds of made-up strip roads, every method of correction
  ./run bench stems --seeds 21-23   fewer
  ./run bench stems --real          Wild-Places V-03 (where the example data is): odometry, loops,
                                    time, memory, and Go-ICP on its neighbouring views
  ./run bench stems --spoilt        the same forest with stems missed, added, moved or out of view
  ./run bench stems --orders        P0's powers with their pairs in each order, on the same roads
  ./run bench stems --rules         P0's pairs or those chosen by Delaunay stars, the same roads
  ./run bench stems --search        where ICP converges (a picture), and what Go-ICP's search costs
  ./run bench stems --table --runs FOLDER [--site-seed N] [--sites lieksa1,lieksa2]
                                    P1's table 1 over whole simulated sites, by stems alone and by
                                    LeGO-LOAM's method; runs that are in the folder are not made
                                    again (each takes minutes), and figures 9 and 10 of P1 use the
                                    same: ./run accuracy --figures -o FOLDER --seed N --only P1-F9
  ./run bench stems --write         puts the tables into docs/method/sparse-experiments.md

The roads are those of tests/stems/strip_roads.py: three, 22.5 m apart. Truth is for the
columns of the table alone; `understory correct` never sees it. Everything runs on one thread.
"""

import argparse
import concurrent.futures
import json
import os
import statistics
import sys
import tempfile
from pathlib import Path

from program import (DONE, PROGRAM, TOP, UNTRUSTED, machine, run, say, understory,
                     understory_json, version)
from spoilt_stems import WAYS, spoil

sys.path.insert(0, str(TOP / "tests" / "stems"))
from strip_road_table import table_page  # noqa: E402
from strip_roads import Roads, write_strip_roads  # noqa: E402

PAGE = TOP / "docs" / "method" / "sparse-experiments.md"
PICTURE = TOP / "docs" / "pictures" / "stem_convergence.svg"
TILT_PICTURE = TOP / "docs" / "pictures" / "stem_convergence_tilt.svg"
TILT_REACH = 3.0  # of stem_search's tilts, in units of phi0
ORDERS = ("small", "medium", "random", "gain")
METHODS = ("none", "powers", "powers_printed", "lattice", "pose_graph", "gaussian_process",
           "expected_gain")
ODOMETRIES = {"frame": "view to view, P0 (16)", "map": "view to local map"}


def data():
    return Path(os.environ.get("UNDERSTORY_DATA", TOP.parent / "shared" / "data"))


def corrected(stems, folder, *settings):
    """One run of correct on one thread: run.json with the kernel's figures."""
    options = [word for setting in settings for word in ("--set", setting)]
    done = understory("correct", stems, "-o", folder, "--overwrite", "--threads", 1, *options,
                      accept=(DONE, UNTRUSTED))
    result = json.loads((folder / "run.json").read_text())
    result["process"] = {"cpu_s": done.cpu_s, "peak_memory_mb": result["peak_memory_mb"]}
    return result


def longest_segment(errors):
    return max(errors["segments"], key=lambda s: s["length_m"])["translation_plane_percent"]


def measure(site, method, odometry, best, *settings):
    folder = site / "-".join((odometry, method, *settings))
    told = corrected(site / "stems.csv.gz", folder, f"correction.method={method}",
                     f"odometry.target={odometry}", *settings)
    path = understory_json("evaluate", folder, site / "truth", "--align", "se3")
    ours = understory_json("evaluate", "map", site / "stems.csv.gz", folder)
    quality = told["quality"]
    stage = told["stages"]["self_correction"]
    return {
        "beta": quality["beta_after"], "d": quality["box_dimension_after"],
        "e_c": quality["registration_noise_after_m"],
        "e_c_ratio": quality["registration_noise_after_m"] / best["registration_noise_m"],
        "roads": statistics.mean(r["consistency"] for r in ours["roads"]) if ours["roads"]
        else float("nan"),
        "plane_m": path["ape_plane_rmse_m"], "space_m": path["ape_rmse_m"],
        "segment": longest_segment(path),
        "share": told["counts"]["corrections"] / told["scans"],
        "cpu_s": stage["cpu_ms"]["mean"] / 1e3,
    }


def method_table(rows):
    text = ("| odometry | correction | beta | d | e_C of single trees, cm | of that with true poses | same trees on "
            "two roads % | path, plane cm | in space cm | over the longest segments % | corrections "
            "% of views | s |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n")
    for odometry in ODOMETRIES:
        for method in METHODS:
            cell = [r for r in rows if r["odometry"] == odometry and r["method"] == method]

            def mean(key, scale=1.0, digits=1):
                values = [scale * r[key] for r in cell]
                return f"{statistics.mean(values):.{digits}f} ({max(values):.{digits}f})"

            text += (f"| {ODOMETRIES[odometry]} | {method} | {mean('beta', 1, 4)} | "
                     f"{mean('d', 1, 2)} | {mean('e_c', 100)} | {mean('e_c_ratio', 1, 2)} | "
                     f"{statistics.mean(100 * r['roads'] for r in cell):.1f} | "
                     f"{mean('plane_m', 100)} | {mean('space_m', 100)} | {mean('segment', 1, 2)} | "
                     f"{statistics.mean(100 * r['share'] for r in cell):.1f} | "
                     f"{statistics.mean(r['cpu_s'] for r in cell):.1f} |\n")
    return text


def measured_rows(seeds, length_m, keep):
    rows = []
    for seed in seeds:
        with tempfile.TemporaryDirectory() as scratch:
            site = Path(scratch)
            views = write_strip_roads(site, seed, Roads(length_m=length_m, step_m=1.0))
            best = understory_json("evaluate", "map", site / "stems.csv.gz", site / "truth")
            for odometry in ODOMETRIES:
                for method in METHODS:
                    row = measure(site, method, odometry, best)
                    rows.append({"seed": seed, "odometry": odometry, "method": method,
                                 "views": views, **row})
                    if keep:
                        keep.write(json.dumps(rows[-1]) + "\n")
                        keep.flush()
                    say(f"seed {seed} {odometry} {method}: e_C {100 * row['e_c']:.1f} cm, path "
                        f"{100 * row['plane_m']:.1f} cm")
    return rows


def compared(seeds, length_m, title, choices):
    """A table of choices, each a name with a method, an odometry and settings."""
    rows = {name: [] for name in choices}
    for seed in seeds:
        with tempfile.TemporaryDirectory() as scratch:
            site = Path(scratch)
            write_strip_roads(site, seed, Roads(length_m=length_m, step_m=1.0))
            best = understory_json("evaluate", "map", site / "stems.csv.gz", site / "truth")
            for name, (method, odometry, *settings) in choices.items():
                rows[name].append(measure(site, method, odometry, best, *settings))
                say(f"seed {seed} {name}: path {100 * rows[name][-1]['plane_m']:.1f} cm")
    text = (f"{version()}, seeds {', '.join(map(str, seeds))}; mean and in brackets the worst\n\n"
            f"| {title} | beta | d | e_C of single trees, cm | of that with true poses | path, plane cm | corrections % of "
            "views |\n|---|---|---|---|---|---|---|\n")
    for name, cell in rows.items():
        def mean(key, scale=1.0, digits=1):
            values = [scale * r[key] for r in cell]
            return f"{statistics.mean(values):.{digits}f} ({max(values):.{digits}f})"
        text += (f"| {name} | {mean('beta', 1, 4)} | {mean('d', 1, 2)} | {mean('e_c', 100)} | "
                 f"{mean('e_c_ratio', 1, 2)} | {mean('plane_m', 100)} | {mean('share', 100)} |\n")
    return text


def order_page(seeds, length_m):
    """P0 table 1 over made-up roads: the paper's odometry and powers, its pairs in each order. Stars
    have pairs of their own: those that the association of Delaunay stars (P0 section 3) draws, as it
    draws them."""
    choices = {order: ("powers", "frame", f"correction.order={order}") for order in ORDERS}
    choices["stars"] = ("powers", "frame", "correction.pairs.rule=delaunay_stars")
    return compared(seeds, length_m, "order", choices)


def rule_page(seeds, length_m):
    """Pairs spread like Poisson disks, P0 (28, 29), or by the association of Delaunay stars."""
    return compared(seeds, length_m, "odometry, correction, choice of pairs",
                    {f"{ODOMETRIES[odometry]}, {method}, {rule}":
                     (method, odometry, f"correction.pairs.rule={rule}")
                     for odometry in ODOMETRIES
                     for method in ("powers", "pose_graph", "gaussian_process")
                     for rule in ("poisson_disks", "delaunay_stars")})


def stem_search(what, stands):
    done = run(PROGRAM.parent / "benchmarks" / "stem_search", what, stands)
    if done.code != 0:
        sys.exit(f"stem_search: {done.stderr.strip()[-200:]}")
    return json.loads(done.stdout)


def convergence_picture(found, turn, reach):
    """Share of starts from which ICP comes home, over shift and yaw or tilt, with the ellipse of P0
    (26). Ten steps of the turn are `reach` times the region's."""
    share, cell, left, top = found["share"], 26, 62, 16
    steps, size = len(share), 26 * len(share)

    def label(x, y, text, more=""):
        return f'<text x="{x}" y="{y}" font-size="12" font-family="sans-serif"{more}>{text}</text>'

    marks = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {left + size + 20} '
             f'{top + size + 52}">', '<rect width="100%" height="100%" fill="white"/>']
    for a, row in enumerate(share):
        for b, value in enumerate(row):
            shade = round(235 * (1 - value))
            marks.append(f'<rect x="{left + cell * a}" y="{top + size - cell * (b + 1)}" '
                         f'width="{cell}" height="{cell}" fill="rgb({20 + shade},{110 + shade // 2},'
                         f'{60 + round(0.75 * shade)})"/>')
    # Cells stand for their middles: the first for no shift and no yaw.
    wide, high = 10 * cell, 10 * cell / reach
    marks.append(f'<path d="M {left + cell / 2 + wide} {top + size - cell / 2} A {wide} {high:.1f} '
                 f'0 0 0 {left + cell / 2} {top + size - cell / 2 - high:.1f}" fill="none" '
                 'stroke="black" stroke-width="2"/>')
    for k in range(0, steps, 2):
        middle = left + cell * k + cell / 2
        marks.append(label(middle, top + size + 16, f"{0.1 * k * found['delta0_m']:.1f}",
                           ' text-anchor="middle"'))
        marks.append(label(left - 6, top + size - cell * k - 9,
                           f"{0.1 * k * found['turn_deg']:.1f}", ' text-anchor="end"'))
    marks.append(label(left + size / 2, top + size + 38, "shift, m", ' text-anchor="middle"'))
    marks.append(label(14, top + size / 2, f"{turn}, °"))
    return "\n".join(marks) + "\n</svg>\n"


def home_shares(found, reach):
    """Mean and least share of the starts within P0 (26), and mean of those beyond 1.2 times it."""
    cells = [(value, a * a + b * b * reach * reach) for a, row in enumerate(found["share"])
             for b, value in enumerate(row)]
    inside = [value for value, squared in cells if squared <= 100]
    return (statistics.mean(inside), min(inside),
            statistics.mean(value for value, squared in cells if squared > 144))


def search_table(head, names, found):
    text = f"| {head} | cells | boxes looked at | ms | right |\n|---|---|---|---|---|\n"
    for key, name in names.items():
        row = found[key]
        if row["nodes"] <= 1:
            text += f"| {name} | {row['cells']:,} | | | |\n"
            continue
        text += (f"| {name} | {row['cells']:,} | {row['nodes']:,} | {row['ms']:.0f} | {row['right']} of "
                 f"{row['stands']} |\n")
    return text


def search_page(write):
    yaw, tilt = stem_search("convergence", 200), stem_search("tilt", 200)
    in_yaw, in_tilt = home_shares(yaw, 1.0), home_shares(tilt, TILT_REACH)
    if write:
        PICTURE.write_text(convergence_picture(yaw, "yaw", 1.0))
        TILT_PICTURE.write_text(convergence_picture(tilt, "tilt", TILT_REACH))
    text = (f"{version()}, {yaw['stands']} stands, delta0 {yaw['delta0_m']:.2f} m, theta0 "
            f"{yaw['turn_deg']:.1f}°: of the starts within (26) {100 * in_yaw[0]:.1f} % "
            f"converge (at the worst place of the grid {100 * in_yaw[1]:.0f} %), of those beyond 1.2 "
            f"times its size {100 * in_yaw[2]:.0f} %. With tilt instead of yaw, phi0 8.2°: "
            f"{100 * in_tilt[0]:.1f} % ({100 * in_tilt[1]:.0f} %); without a shift "
            f"{100 * min(tilt['share'][0]):.0f} % from every tilt up to "
            f"{1.4 * tilt['turn_deg']:.0f}°.\n\n")
    text += search_table("search over yaw and ±5 m", {
        "general": "any cloud: cubes, ±180°, down to 1.0° and 1.2 m",
        "uniform": "near-uniform: cubes, ±60°, down to theta0 and delta0",
        "elongated": "the same, elongated boxes",
        "certified_cubes": "certified to 2 cm, ±60°, cubes",
        "certified": "certified to 2 cm, ±60°, elongated boxes"}, stem_search("boxes", 40))
    return text + "\n" + search_table("search in space", {
        "general": "any cloud, ±180°, tilt ±90°, ±5 and ±1 m, down to 1.0° and 1.2 m: counted only",
        "uniform": "near-uniform: cubes, ±180°, tilt ±30°, down to theta0, phi0 and delta0",
        "elongated": "the same, elongated boxes",
        "near": "elongated, ±15°, tilt ±10°, ±2 and ±1 m",
        "certified": "the same, certified to 10 cm"}, stem_search("space", 4))


def method_page(rows, length_m):
    """Of the seeds that every method was measured on."""
    wanted = len(METHODS) * len(ODOMETRIES)
    seeds = sorted({r["seed"] for r in rows})
    seeds = [s for s in seeds if sum(r["seed"] == s for r in rows) == wanted]
    rows = [r for r in rows if r["seed"] in seeds]
    head = (f"{version()}, seeds {', '.join(map(str, seeds))}: mean and in brackets the worst; three "
            f"roads of {length_m:.0f} m, {rows[0]['views']} views\n\n")
    return head + method_table(rows)


def loops_of(folder, truth_file):
    """Recall at 1 and at full precision: views whose truth has an earlier place within 3 m, at
    least 50 views apart, count."""
    truth = [list(map(float, line.split()[1:4])) for line in truth_file.read_text().splitlines()
             if line and line[0] != "#"]

    def near(a, b):
        return sum((p - q) ** 2 for p, q in zip(truth[a], truth[b])) <= 9.0

    queries = [i for i in range(len(truth)) if any(near(i, j) for j in range(0, i - 49))]
    rows = [line.split(",") for line in (folder / "loops.csv").read_text().splitlines()[1:]]
    found = {int(q): (int(m), float(s)) for q, m, s, *_ in rows}
    right = {q for q, (m, _) in found.items() if near(q, m) and q - m >= 50}
    wrong = [s for q, (m, s) in found.items() if q not in right]
    over = [q for q in queries if q in right and found[q][1] > max(wrong, default=-1.0)]
    accepted = [(int(q), int(m)) for q, m, _, a, *_ in rows if a == "1"]
    return {"queries": len(queries), "recall": sum(q in right for q in queries) / len(queries),
            "recall_full_precision": len(over) / len(queries), "accepted": len(accepted),
            "accepted_right": sum(near(q, m) for q, m in accepted)}


def go_icp_rows(stems, truth):
    text = "| Go-ICP and ICP, neighbouring views, 130 stems | mean ms | p50 | p99 | right |\n|---|---|---|---|---|\n"
    for name, mode, yaw, shift, stride in (
            ("certified to 2 cm, ±1.5 m and ±15° around a wrong guess", "certified", 15, 1.5, 8),
            ("certified to 2 cm, ±5 m and ±180°", "certified", 180, 5, 12),
            ("the paper's mode, ±1.5 m and ±15°", "paper", 15, 1.5, 8),
            ("ICP alone from the same wrong guess", "icp", 15, 1.5, 8),
            ("ICP alone from a prediction, up to 0.25 m and 2.5° off", "icp", 5, 0.5, 8)):
        done = run(PROGRAM.parent / "benchmarks" / "stem_pairs", stems, truth, mode, yaw, shift,
                   stride)
        if done.code != 0:
            return f"(stem_pairs cannot be run: {done.stderr.strip()[-200:]})\n"
        r = json.loads(done.stdout)
        digits = 1 if r["mean_ms"] >= 1 else 2
        text += (f"| {name} | {r['mean_ms']:.{digits}f} | {r['p50_ms']:.{digits}f} | {r['p99_ms']:.{digits}f} | "
                 f"{r['right']} of {r['pairs']} |\n")
    return text


def bench_real():
    folder = data() / "wild_places_v03"
    stems, truth = folder / "stems.csv.gz", folder / "trajectory.tum"
    if not stems.exists():
        return "The example data is not here (UNDERSTORY_DATA).\n"
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "run"
        told = corrected(stems, out)
        before = understory_json("evaluate", out / "odometry.tum", truth, "--align", "se3")
        after = understory_json("evaluate", out / "trajectory.tum", truth, "--align", "se3")
        loops = loops_of(out, truth)
    segments = [s for s in before["segments"] if s["length_m"] in (100, 200, 300, 400)]
    quality = told["quality"]
    rows = [
        ("odometry, segments of 100 / 200 / 300 / 400 m, in plane",
         " / ".join(f"{s['translation_plane_percent']:.2f}" for s in segments) + " %"),
        ("the same in space", " / ".join(f"{s['translation_percent']:.1f}" for s in segments) + " %"),
        ("APE in plane, aligned by SE(3): chained odometry / result",
         f"{before['ape_plane_rmse_m']:.2f} / {after['ape_plane_rmse_m']:.2f} m"),
        ("the same in space", f"{before['ape_rmse_m']:.1f} / {after['ape_rmse_m']:.1f} m"),
        (f"loops: recall@1 ({loops['queries']} queries) / at 100 % precision",
         f"{loops['recall']:.3f} / {loops['recall_full_precision']:.3f}"),
        ("loops accepted / right", f"{loops['accepted']} / {loops['accepted_right']}"),
        ("beta, d of the map: after loops / after self-correction",
         f"{quality['beta_before']:.4f}, {quality['box_dimension_before']:.2f} / "
         f"{quality['beta_after']:.4f}, {quality['box_dimension_after']:.2f}"),
        ("e_C, P0 (33), of all clusters (P0: 15 cm)",
         f"{100 * quality['cluster_noise_before_m']:.1f} / {100 * quality['cluster_noise_after_m']:.1f} cm"),
        ("e_C of single trees",
         f"{100 * quality['registration_noise_before_m']:.1f} / "
         f"{100 * quality['registration_noise_after_m']:.1f} cm"),
        ("corrections", f"{told['counts']['corrections']} of {told['scans']} views"),
        ("trees", str(told["counts"]["trees"])),
        ("processor time, one thread / memory",
         f"{told['process']['cpu_s']:.0f} s / {told['process']['peak_memory_mb']:.0f} MB"),
    ]
    text = f"{version()}, {machine()}\n\n| Wild-Places V-03 | |\n|---|---|\n"
    text += "".join(f"| {name} | {value} |\n" for name, value in rows)
    return text + "\n" + go_icp_rows(stems, truth)


def bench_spoilt():
    folder = data() / "wild_places_v03"
    stems, truth = folder / "stems.csv.gz", folder / "trajectory.tum"
    if not stems.exists():
        return "The example data is not here (UNDERSTORY_DATA).\n"

    def measured(job):
        way, gather = job
        with tempfile.TemporaryDirectory() as scratch:
            spoilt, out = Path(scratch) / "stems.csv.gz", Path(scratch) / "run"
            spoil(stems, spoilt, way)
            told = corrected(spoilt, out, *([] if gather else ["loops.gather_l0=0"]))
            before, after = (
                understory_json("evaluate", out / name, truth, "--align", "se3")["ape_plane_rmse_m"]
                for name in ("odometry.tum", "trajectory.tum"))
            return {**loops_of(out, truth), "before": before, "after": after,
                    "cpu_s": told["process"]["cpu_s"]}

    jobs = [(way, gather) for way in WAYS for gather in (False, True)]
    with concurrent.futures.ThreadPoolExecutor(2) as workers:
        found = dict(zip(jobs, workers.map(measured, jobs)))
    text = (f"{version()}, {machine()}\n\n| Wild-Places V-03 | recall@1: single views / laid together "
            "| loops accepted, right | APE in plane: odometry / result, m (single views) | s |\n"
            "|---|---|---|---|---|\n")
    for way in WAYS:
        single, gathered = found[way, False], found[way, True]
        text += (f"| {way} | {single['recall']:.3f} / {gathered['recall']:.3f} | "
                 f"{gathered['accepted']}, {gathered['accepted_right']} | {gathered['before']:.2f} / "
                 f"{gathered['after']:.2f} ({single['after']:.2f}) | {gathered['cpu_s']:.0f} |\n")
    return text


def put(name, text):
    begin, end = f"<!-- {name}: ./run bench stems --write -->", f"<!-- end of {name} -->"
    page = PAGE.read_text()
    head, rest = page.split(begin, 1)
    _, tail = rest.split(end, 1)
    PAGE.write_text(f"{head}{begin}\n{text}{end}{tail}")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="21-30", help="first-last")
    parser.add_argument("--length-m", type=float, default=100.0, help="of each road")
    parser.add_argument("--real", action="store_true", help="only the real forest")
    parser.add_argument("--spoilt", action="store_true", help="only that forest spoilt")
    parser.add_argument("--methods", action="store_true", help="only the made-up roads")
    parser.add_argument("--orders", action="store_true", help="only the orders of corrections")
    parser.add_argument("--rules", action="store_true", help="only the choices of pairs")
    parser.add_argument("--search", action="store_true", help="only the searches")
    parser.add_argument("--table", action="store_true", help="only P1's table 1")
    parser.add_argument("--runs", help="folder of the runs of --table")
    parser.add_argument("--site-seed", type=int, default=22)
    parser.add_argument("--sites", default="lieksa1,lieksa2,lieksa3")
    parser.add_argument("--seconds", type=float, help="with --table: only the first so many of each site")
    parser.add_argument("--rows", help="file that keeps what was measured; its seeds are not "
                        "measured again")
    parser.add_argument("--write", action="store_true", help="into docs/method/sparse-experiments.md")
    options = parser.parse_args()
    first, last = map(int, options.seeds.split("-"))
    tables = {}
    if options.table:
        with tempfile.TemporaryDirectory() as scratch:
            tables["strip roads"] = table_page(options.sites.split(","), options.site_seed,
                                               options.runs or scratch, options.seconds)
    everything = not (options.table or options.methods or options.real or options.orders
                      or options.rules or options.search or options.spoilt)
    if everything or options.spoilt:
        tables["spoilt forest"] = bench_spoilt()
    if everything or options.search:
        tables["searches"] = search_page(options.write)
    if everything or options.orders:
        tables["orders of corrections"] = order_page(range(first, last + 1), options.length_m)
    if everything or options.rules:
        tables["choices of pairs"] = rule_page(range(first, last + 1), options.length_m)
    if everything or options.real:
        tables["real forest"] = bench_real()
    if everything or options.methods:
        rows = []
        if options.rows and Path(options.rows).exists():
            rows = [json.loads(line) for line in Path(options.rows).read_text().splitlines()]
        known = {r["seed"] for r in rows}
        seeds = [seed for seed in range(first, last + 1) if seed not in known]
        with open(options.rows or os.devnull, "a", encoding="utf-8") as keep:
            rows += measured_rows(seeds, options.length_m, keep)
        tables["methods of correction"] = method_page(rows, options.length_m)
    for name, text in tables.items():
        print(text)
        if options.write:
            put(name, text)


if __name__ == "__main__":
    main()
