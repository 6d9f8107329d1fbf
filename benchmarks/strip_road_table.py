"""Table 1 of P1 for simulated strip roads: `./run bench stems --table`. Each road is mapped by stems alone (sSLAM) and by
all points with LeGO-LOAM's method (LLOAM). The truth places the runs beside each other and judges them; the program never
sees it before."""

import math
import statistics
from pathlib import Path

from figures.road_jobs import road_jobs_of
from figures.runs import Runs
from program import Failed, understory_json, version

RING_M, REACH_M = 5, 40
ANTENNA_M = (0, 0.3, 3.1)  # gnss.mount_m of the sites
SHORT = {"translation_plane_percent": math.nan}  # of a way that has no segment
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


def mapping_range_m(rings):
    reach = 0
    for ring in rings:
        if ring["expected"] > 0 and ring["recall"] < FOUND:
            break
        reach = ring["to_m"]
    return reach


def kb_per_100_m(file, way_m):
    return file.stat().st_size / 1e3 / way_m * 100


def measure_road(run, folder):
    """The figures that both ways of mapping a road have: by stems alone, and by all points."""
    site, truth, told = run.job.recording.site, run.truth, run.told
    path = understory_json("evaluate", run.folder, truth, "--align", "se3")
    gnss = {}
    for name, moved in (("ours", run.folder), ("truth", truth)):
        gnss[name] = understory_json(
            "georeference", moved, "--method", "gnss-path", "--gnss", run.folder / "gnss.csv", "-o",
            folder / f"{run.job.name}_gnss_{name}", "--overwrite", "--antenna-m", *ANTENNA_M)
    level = folder / f"{run.job.name}_level"
    terrain = understory_json("georeference", run.folder, "--method", "terrain", "--dem", truth / "dtm.tif",
                              "--start", *start_of(run.folder, truth), "-o", level, "--overwrite")
    rings = understory_json("evaluate", "trees", level, truth, "--matching", "nearest", "--truth-returns", truth, "--path", truth,
                            "--bin-m", RING_M, "--reach-m", REACH_M)["by_distance"]
    way = path["length_m"]  # the true one, the same for both ways of mapping
    return {
        "site": site, "way": run.job.way, "level": level, "rings": rings, "way_m": way, "scans": told["scans"],
        "map_kb": kb_per_100_m(run.folder / "trees.csv", way),
        "plane_cm": 100 * path["ape_plane_rmse_m"], "space_cm": 100 * path["ape_rmse_m"],
        "segment": max(path["segments"], key=lambda s: s["length_m"], default=SHORT)["translation_plane_percent"],
        "gnss": gnss, "terrain": terrain,
        "height_cm": [100 * height_sd_m(folder_, truth) for folder_ in (run.folder, level)],
        "range_m": mapping_range_m(rings), "memory_mb": told["peak_memory_mb"],
        "cpu_ms": told["stages"]["scan"]["cpu_ms"]["mean"],
    }


def measure_stems(run, folder):
    """A road that was mapped by stems alone; adds what tells how sharp its map is."""
    sharp = [understory_json("evaluate", "map", run.folder / "stems.csv.gz", path)
             for path in (run.folder / "odometry.tum", run.folder, run.truth)]
    before = understory_json("evaluate", run.folder / "odometry.tum", run.truth, "--align", "se3")
    road = measure_road(run, folder)
    return road | {
        "views": run.told["counts"]["views"], "axis_deg": run.told["quality"]["axis_noise_deg"],
        "kb": kb_per_100_m(run.folder / "stems.csv.gz", road["way_m"]),
        "before_cm": [100 * before["ape_plane_rmse_m"], 100 * before["ape_rmse_m"]],
        "sharp": [(100 * m["cluster_noise_m"], 100 * m["registration_noise_m"], 1e3 * m["beta"], m["box_dimension"])
                  for m in sharp],
        "share": 100 * run.told["quality"]["corrections_share"],
    }


def measure_points(run, folder):
    """A road whose map of all points LeGO-LOAM's method made. The stems of this map are the trees of the run."""
    road = measure_road(run, folder)
    return road | {"cloud_kb": kb_per_100_m(run.folder / "map.laz", road["way_m"])}


def between(a, b):
    told = understory_json("evaluate", "trees", a["level"], b["level"], "--path", a["level"],
                           "--other-path", b["level"])
    return told["consistency"]


def rows_of_roads():
    """Name, cell of a road by stems, of one by all points (None: it has none), and what P1 has of both."""
    both = lambda cell: (cell, cell)
    yield ("way, m", *both(lambda r: f"{r['way_m']:.0f}"), "", "")
    yield "views kept", lambda r: f"{r['views']}", None, "", ""
    yield "stems of all views, kB per 100 m", lambda r: f"{r['kb']:,.0f}", None, "450", ""
    yield "cloud that stems are found in, kB per 100 m", None, lambda r: f"{r['cloud_kb']:,.0f}", "", "63,000"
    yield "tree map, kB per 100 m", *both(lambda r: f"{r['map_kb']:.1f}"), "", ""
    yield ("path in the plane, cm: before / after correction", lambda r: f"{r['before_cm'][0]:.1f} / {r['plane_cm']:.1f}",
           lambda r: f"{r['plane_cm']:.1f}", "", "")
    yield ("path in space, cm", lambda r: f"{r['before_cm'][1]:.1f} / {r['space_cm']:.1f}",
           lambda r: f"{r['space_cm']:.1f}", "", "")
    yield "the same in plane over the longest segments, %", *both(lambda r: f"{r['segment']:.2f}"), "0.41 to 0.5", "0.5"
    yield ("fixes off the path, mean, m (off the true path)", *both(lambda r: "{:.2f} ({:.2f})".format(
        *(r["gnss"][k]["gnss_fixes_mean_m"] for k in ("ours", "truth")))), "0.8", "0.8")
    yield ("fit to GNSS, root of (6), m (true path)", *both(lambda r: "{:.2f} ({:.2f})".format(
        *(r["gnss"][k]["gnss_fit_rms_m"] for k in ("ours", "truth")))), "", "")
    yield ("GNSS along the way by time, m (true path)", *both(lambda r: "{:.2f} ({:.2f})".format(
        *(r["gnss"][k]["gnss_along_rms_m"] for k in ("ours", "truth")))), "0.41", "0.84")
    yield ("feet above the terrain model, m: before / after levelling", *both(lambda r: "{:.2f} / {:.2f}".format(
        r["terrain"]["terrain_rms_before_m"], r["terrain"]["terrain_rms_m"])), "0.94", "0.37")
    yield "height of the path, cm, the same", *both(lambda r: "{:.0f} / {:.0f}".format(*r["height_cm"])), "", ""
    yield "vertical angular noise of stems, degrees", lambda r: f"{r['axis_deg']:.1f}", None, "2.0", ""
    yield f"mapping range ({100 * FOUND:.0f} % found), m", *both(lambda r: f"{r['range_m']:g}"), "20", "20"
    for k, (name, digits, paper) in enumerate((("e_C, P0 (33), cm", 1, "15 (P0)"), ("e_C of single trees, cm", 1, ""),
                                               ("beta, per mille", 2, ""), ("d", 3, ""))):
        yield (f"{name}: before / after correction / with true poses",
               lambda r, k=k, digits=digits: " / ".join(f"{m[k]:.{digits}f}" for m in r["sharp"]), None, paper, "")
    yield "corrections, % of the views", lambda r: f"{r['share']:.1f}", None, "", ""
    yield "processor time a scan, ms", *both(lambda r: f"{r['cpu_ms']:.1f}"), "", ""
    yield "peak memory, MB", *both(lambda r: f"{r['memory_mb']:.0f}"), "", ""


def consistencies(roads, points):
    """Name and consistency of each pair of maps: neighbouring roads by one way, and one road by both."""
    pairs = [(f"{a['site']}, {b['site']}, {name}", a, b) for name, group in (("by stems", roads), ("by all points", points))
             for a, b in zip(group, group[1:])]
    pairs += [(f"{a['site']}, by stems and by all points", a, b) for a, b in zip(roads, points)]
    return [(name, between(a, b)) for name, a, b in pairs]


def consistency_table(pairs):
    lines = ["| trees of | within 20 m of both | the same, as placed | after one motion | in parts |",
             "|---|---|---|---|---|", "| P1, sSLAM | | | 79 % | 85 % |", "| P1, LLOAM | | | 75 % | 77 % |"]
    return lines + [f"| {name} | {c['trees_a']}, {c['trees_b']} | {100 * c['as_placed']:.1f} % | "
                    f"{100 * c['moved']:.1f} % | {100 * c['in_parts']:.1f} % |" for name, c in pairs]


def ring_table(roads, points):
    lines = ["| distance from the way, m | " + " | ".join(
        f"{ring['from_m']:g}-{ring['to_m']:g}" for ring in roads[0]["rings"]) + " |",
        "|---|" + "---|" * len(roads[0]["rings"])]
    for name, group in (("by stems", roads), ("by all points", points)):
        for r in group:
            lines.append(f"| {r['site']} {name}: standing trees found, % | " + " | ".join(
                f"{100 * ring['recall']:.1f}" if ring["expected"] else "" for ring in r["rings"]) + " |")
            lines.append("| listed trees right, % | " + " | ".join(
                f"{100 * ring['precision']:.1f}" if ring["reported"] else "" for ring in r["rings"]) + " |")
    return lines


def page_of(head, roads, points, pairs):
    sites = [r["site"] for r in roads]
    columns = [*(f"{site}, by stems" for site in sites), "P1, sSLAM", *(f"{site}, by all points" for site in sites),
               "P1, LLOAM"]
    lines = [head, "", "| | " + " | ".join(columns) + " |", "|---|" + "---|" * len(columns)]
    for name, by_stems, by_points, paper, paper_points in rows_of_roads():
        cells = [*(by_stems(r) if by_stems else "" for r in roads), paper,
                 *(by_points(r) if by_points else "" for r in points), paper_points]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join([*lines, "", *consistency_table(pairs), "", *ring_table(roads, points)]) + "\n"


def table_page(sites, seed, folder, seconds=None):
    """The page of the table; `seconds`: only so much of each road. The runs lie in `folder`, as those of
    `./run accuracy --figures -o FOLDER --seed SEED --only P1-F9` do, and are not made again."""
    folder = Path(folder)
    runs = Runs(folder)
    jobs = road_jobs_of(sites, seed, seconds)
    runs.make(jobs.values())
    made = {key: runs.get(job) for key, job in jobs.items()}
    for run in made.values():
        if run.failed:
            raise Failed(f"{run.job.name}: {run.failed}")
    measured = folder / "runs"
    roads = [measure_stems(made[site, "stems"], measured) for site in sites]
    points = [measure_points(made[site, "loam"], measured) for site in sites]
    part = "whole sites" if seconds is None else f"first {seconds:g} s of each"
    return page_of(f"{version()}, seed {seed}; {part}", roads, points, consistencies(roads, points))
