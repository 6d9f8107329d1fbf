"""Table 1 of P1 for simulated strip roads: `./run bench stems --table`. The truth places the runs beside each
other and judges them; the program never sees it before."""

import json
import math
import statistics
from pathlib import Path

from program import DONE, UNTRUSTED, simulated, understory, understory_json

RING_M, REACH_M = 5, 40
FOUND = 0.85  # of the trees of a ring that still counts as mapped


def poses(folder):
    rows = (line.split() for line in (folder / "trajectory.tum").read_text().splitlines())
    return {row[0]: tuple(map(float, row[1:4])) for row in rows if row[0] != "#"}


def start_of(run, truth):
    """x, y, yaw in degrees of the run's frame in the truth's: least squares in the plane."""
    ours, true = poses(run), poses(truth)
    pairs = [(complex(*ours[t][:2]), complex(*true[t][:2])) for t in sorted(ours.keys() & true.keys())]
    a, b = (statistics.fmean(p[k].real for p in pairs) + 1j * statistics.fmean(p[k].imag for p in pairs)
            for k in (0, 1))
    turn = sum((p - a).conjugate() * (q - b) for p, q in pairs)
    turn /= abs(turn)
    shift = b - turn * a
    return shift.real, shift.imag, math.degrees(math.atan2(turn.imag, turn.real))


def height_sd_m(run, truth):
    """Of the path's height about its mean error."""
    ours, true = poses(run), poses(truth)
    return statistics.pstdev(ours[t][2] - true[t][2] for t in ours.keys() & true.keys())


def mapped_run(site, seed, folder):
    """Maps a whole site by stems alone, or takes the run that is there."""
    run = folder / f"{site}_{seed}"
    if not (run / "run.json").exists():
        understory("map", simulated(site, seed=seed), "-o", run, "--front-end", "sparse", "--threads", 1,
                   accept=(DONE, UNTRUSTED))
    return run


def mapping_range_m(rings):
    reach = 0
    for ring in rings:
        if ring["expected"] > 0 and ring["recall"] < FOUND:
            break
        reach = ring["to_m"]
    return reach


def measure_road(site, seed, folder):
    run = mapped_run(site, seed, folder)
    truth = run.with_name(run.name + ".truth")
    told = json.loads((run / "run.json").read_text())
    path = understory_json("evaluate", run, truth, "--align", "se3")
    fixes = run / "gnss.csv"
    gnss = {}
    for name, moved in (("ours", run), ("truth", truth)):
        gnss[name] = understory_json(
            "georeference", moved, "--method", "gnss-path", "--gnss",
            fixes if fixes.exists() else simulated(site, seed=seed), "-o", folder / f"{run.name}_gnss_{name}",
            "--overwrite", "--antenna-m", 0, 0.3, 3.1)
    level = folder / f"{run.name}_level"
    terrain = understory_json("georeference", run, "--method", "terrain", "--dem", truth / "dtm.tif",
                              "--start", *start_of(run, truth), "-o", level, "--overwrite")
    rings = understory_json("evaluate", "trees", level, truth, "--matching", "nearest", "--truth-returns", truth, "--path", truth,
                            "--bin-m", RING_M, "--reach-m", REACH_M)["by_distance"]
    sharp = understory_json("evaluate", "map", run / "stems.csv.gz", run)
    true = understory_json("evaluate", "map", run / "stems.csv.gz", truth)
    chained = understory_json("evaluate", "map", run / "stems.csv.gz", run / "odometry.tum")
    before = understory_json("evaluate", run / "odometry.tum", truth, "--align", "se3")
    way = told["quality"]["path_length_m"]
    return {
        "site": site, "seed": seed, "level": level, "rings": rings, "way_m": way,
        "kb": (run / "stems.csv.gz").stat().st_size / 1e3 / way * 100,
        "map_kb": (run / "trees.csv").stat().st_size / 1e3 / way * 100,
        "plane_cm": 100 * path["ape_plane_rmse_m"], "space_cm": 100 * path["ape_rmse_m"],
        "segment": max(path["segments"], key=lambda s: s["length_m"])["translation_plane_percent"],
        "gnss": gnss, "terrain": terrain,
        "height_cm": [100 * height_sd_m(folder_, truth) for folder_ in (run, level)],
        "before_cm": [100 * before["ape_plane_rmse_m"], 100 * before["ape_rmse_m"]],
        "axis_deg": told["quality"]["axis_noise_deg"], "range_m": mapping_range_m(rings),
        "sharp": [(100 * m["cluster_noise_m"], 100 * m["registration_noise_m"], 1e3 * m["beta"], m["box_dimension"])
                  for m in (chained, sharp, true)],
        "share": 100 * told["quality"]["corrections_share"],
        "memory_mb": told["peak_memory_mb"], "views": told["counts"]["views"],
    }


def between(a, b):
    told = understory_json("evaluate", "trees", a["level"], b["level"], "--path", a["level"],
                           "--other-path", b["level"])
    return told["consistency"]


def table_page(sites, seed, folder):
    folder = Path(folder)
    roads = [measure_road(site, seed, folder) for site in sites]
    head = f"Seed {seed}; whole sites"
    lines = [head, "", "| | " + " | ".join(r["site"] for r in roads) + " | P1 |",
             "|---|" + "---|" * (len(roads) + 1)]

    def row(name, cell, paper=""):
        lines.append(f"| {name} | " + " | ".join(cell(r) for r in roads) + f" | {paper} |")

    row("way, views kept", lambda r: f"{r['way_m']:.0f} m, {r['views']}")
    row("stems of all views, kB per 100 m", lambda r: f"{r['kb']:.0f}", "450")
    row("tree map, kB per 100 m", lambda r: f"{r['map_kb']:.1f}")
    row("path in the plane, cm: before / after correction",
        lambda r: f"{r['before_cm'][0]:.1f} / {r['plane_cm']:.1f}")
    row("path in space, cm", lambda r: f"{r['before_cm'][1]:.1f} / {r['space_cm']:.1f}")
    row("the same in plane over the longest segments, %", lambda r: f"{r['segment']:.2f}", "0.41 to 0.5")
    row("fixes off the path, mean, m (off the true path)", lambda r: "{:.2f} ({:.2f})".format(
        *(r["gnss"][k]["gnss_fixes_mean_m"] for k in ("ours", "truth"))), "0.8")
    row("fit to GNSS, root of (6), m (true path)", lambda r: "{:.2f} ({:.2f})".format(
        *(r["gnss"][k]["gnss_fit_rms_m"] for k in ("ours", "truth"))))
    row("GNSS along the way by time, m (true path)", lambda r: "{:.2f} ({:.2f})".format(
        *(r["gnss"][k]["gnss_along_rms_m"] for k in ("ours", "truth"))), "0.41")
    row("feet above the terrain model, m: before / after levelling", lambda r: "{:.2f} / {:.2f}".format(
        r["terrain"]["terrain_rms_before_m"], r["terrain"]["terrain_rms_m"]), "0.94")
    row("height of the path, cm, the same", lambda r: "{:.0f} / {:.0f}".format(*r["height_cm"]))
    row("vertical angular noise of stems, degrees", lambda r: f"{r['axis_deg']:.1f}", "2.0")
    row(f"mapping range ({100 * FOUND:.0f} % found), m", lambda r: f"{r['range_m']}", "20")
    for k, (name, digits, paper) in enumerate((("e_C, P0 (33), cm", 1, "15"), ("e_C of single trees, cm", 1, ""), ("beta, per mille", 2, ""), ("d", 3, ""))):
        row(f"{name}: before / after correction / with true poses",
            lambda r: " / ".join(f"{m[k]:.{digits}f}" for m in r["sharp"]), paper)
    row("corrections, % of the views", lambda r: f"{r['share']:.1f}")
    row("peak memory, the simulator's stand included, MB", lambda r: f"{r['memory_mb']:.0f}")
    lines += ["", "| roads | trees within 20 m of both | the same, as placed | after one motion | in parts |",
              "|---|---|---|---|---|", "| P1 | | | 79 % | 85 % |"]
    for a, b in zip(roads, roads[1:]):
        c = between(a, b)
        lines.append(f"| {a['site']}, {b['site']} | {c['trees_a']}, {c['trees_b']} | {100 * c['as_placed']:.1f} % | "
                     f"{100 * c['moved']:.1f} % | {100 * c['in_parts']:.1f} % |")
    lines += ["", "| distance from the way, m | " + " | ".join(
        f"{ring['from_m']:g}-{ring['to_m']:g}" for ring in roads[0]["rings"]) + " |",
        "|---|" + "---|" * len(roads[0]["rings"])]
    for r in roads:
        lines.append(f"| {r['site']}: standing trees found, % | " + " | ".join(
            f"{100 * ring['recall']:.1f}" if ring["expected"] else "" for ring in r["rings"]) + " |")
        lines.append(f"| listed trees right, % | " + " | ".join(
            f"{100 * ring['precision']:.1f}" if ring["reported"] else "" for ring in r["rings"]) + " |")
    return "\n".join(lines) + "\n"
