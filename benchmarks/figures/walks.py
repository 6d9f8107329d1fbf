"""P4, Robotics Approach in Mobile Laser Scanning: figures 14 to 19 and 21 to 23."""

import numpy as np
from matplotlib import ticker

from figures.paper_figure import PaperFigure
from figures.data import enu, laid_on, list_in_site, off_by, origin_of, paired, read_path, read_table, rms
from figures.drawing import Drawn, Sheet
from figures.runs import Job, settings

NO_MAP = settings("map.enabled=false")
NO_LOOPS = settings("loop_closure.enabled=false")
# The configurations of the paper, and what stands for each here.
WAYS = {"ndt-lc": ("NDT with loops", "ours", NO_MAP),
        "ndt": ("NDT", "third", NO_MAP + NO_LOOPS),
        "gicp": ("GICP", "second", NO_MAP + NO_LOOPS + settings("registration.method=gicp")),
        "loam": ("LOAM", "fourth", NO_MAP + NO_LOOPS + settings("registration.method=loam"))}
FUSED = ("NDT, fixes in the graph", "second", NO_MAP + NO_LOOPS + settings("gnss.use=fuse"))
PAPER_DRIFT_M = {  # Table 3, without loops; LIO-SAM stands beside our LOAM
    "ndt": {"evo1": 17.242, "evo2": 0.579, "evo3": 20.320, "tuusniemi1": 0.713, "tuusniemi3": 2.333},
    "gicp": {"evo1": 5906.576, "evo2": 8.537, "evo3": 144.153, "tuusniemi1": 1.204, "tuusniemi3": 39.680},
    "loam": {"evo1": 6.895, "evo2": 0.039, "evo3": 1.917, "tuusniemi1": 0.008, "tuusniemi3": 0.252}}
PAPER_WIDTH_M = {("tuusniemi1", "gicp"): "1.7 m", ("tuusniemi1", "ndt"): "1.2 m", ("tuusniemi1", "ndt-lc"): "0.9 m",
                 ("tuusniemi1", "loam"): "0.9 m", ("tuusniemi3", "ndt-lc"): "0.5 m", ("tuusniemi3", "loam"): "0.6 m",
                 ("tuusniemi3", "ndt"): "0.7 m"}
BATCH_SCANS = 300  # of F21: means over so many scans


def jobs_of(site, ways):
    return lambda plan: {way: Job(plan.recording(site), way, WAYS[way][2]) for way in ways}


def good_runs(runs):
    """The runs that gave a path, and a sentence on the others."""
    good = {name: run for name, run in runs.items() if not run.failed}
    bad = [f" {name} gave no path: {run.failed}." for name, run in runs.items() if run.failed]
    return good, "".join(bad)


def site_title(title, run):
    return f"{title}\n{run.job.recording.says}"


def paper_drift(run, way):
    """What Table 3 of the paper says of a whole site."""
    if run.job.recording.seconds is not None:
        return ""
    metres = PAPER_DRIFT_M.get(way, {}).get(run.job.recording.site)
    return "" if metres is None else f"{metres:g} m"


def draw_trajectories(plan, title, runs):
    good, failures = good_runs(runs)
    reference = good["ndt-lc"]
    onto = read_path(reference.folder / "trajectory.tum")
    truth, _, _ = laid_on(read_path(reference.truth / "trajectory.tum"), onto)
    sheet = Sheet(site_title(title, reference), 1, 2, (9.5, 4.6), {"width_ratios": [1.2, 1]})
    plan_view, errors = sheet.axes[0]
    sheet.line(plan_view, "truth", *truth.places[:, :2].T, "truth", linewidth=3.0, alpha=0.35)
    numbers = []
    for way, run in good.items():
        name, colour, _ = WAYS[way]
        path = onto if way == "ndt-lc" else laid_on(read_path(run.folder / "trajectory.tum"), onto)[0]
        width = 2.6 if way == "ndt-lc" else 1.0  # NDT is the same where no loop was closed
        sheet.line(plan_view, name, *path.places[:, :2].T, colour, linewidth=width)
        times, off = off_by(path, truth)
        sheet.line(errors, name, times - truth.times[0], 100 * off, colour, linewidth=width)
        end = run.errors("first")
        drift = f"{100 * end['drift_end_m']:.1f} cm ({end['drift_percent']:.3f} %)"
        numbers += [(f"{name}: off the truth, RMS", f"{100 * rms(off):.1f} cm", ""),
                    (f"{name}: drift at the end", drift, paper_drift(run, way))]
    sheet.name(plan_view, "paths, fitted on NDT with loops", "x (m)", "y (m)")
    sheet.name(errors, "distance from the truth, fitted alike", "time (s)", "distance (cm)")
    errors.set_yscale("log")
    errors.yaxis.set_major_formatter(ticker.FormatStrFormatter("%g"))
    errors.yaxis.set_minor_formatter(ticker.NullFormatter())
    plan_view.set_aspect("equal", "datalim")
    sheet.legend(plan_view)
    numbers.append(("way", f"{truth.length_m():.0f} m", ""))
    return Drawn(sheet,
                 "The paths of NDT, NDT with loops, GICP and LIO-SAM, each fitted on that of NDT with loops. Some end "
                 "metres away from where they began. No truth tells which is right.",
                 "The same configurations of our program, with LOAM in place of LIO-SAM, and the simulator's truth. The "
                 f"right side shows how far each is off. Drift is the error of the end with the start aligned.{failures}",
                 numbers)


def link_distances(run, onto):
    """Distances of a run's positions, fitted on `onto` in the truth's frame, from the prism on another link."""
    prism = read_table(run.truth / "total_station.csv", "timestamp", "x", "y", "z")
    path, _, _ = laid_on(read_path(run.folder / "trajectory.tum"), onto)
    i, j = paired(prism[:, 0], path.times, 0.05)
    return np.linalg.norm(prism[i, 1:] - path.places[j], axis=1)


def draw_distances(plan, title, sites):
    sheet = Sheet(f"{title}\nseed {plan.seed}", 2, 1, (8.0, 6.4))
    numbers, words = [], ""
    for axes, (site, runs) in zip(sheet.axes[:, 0], sites.items()):
        good, failures = good_runs(runs)
        words += failures
        reference = good["ndt-lc"]
        onto, _, _ = laid_on(read_path(reference.folder / "trajectory.tum"),
                             read_path(reference.truth / "trajectory.tum"))
        found = {way: link_distances(run, onto) for way, run in good.items()}
        every = np.concatenate(list(found.values()))
        low, high = np.floor(every.min() * 100) / 100, np.ceil(every.max() * 100) / 100
        step = 0.1 if high - low > 2.0 else 0.01 if high - low > 0.2 else 0.001
        edges = np.arange(low - step, high + 2 * step, step)
        for way, distances in found.items():
            name, colour, _ = WAYS[way]
            share, _ = np.histogram(distances, edges)
            sheet.line(axes, name, edges[:-1] + step / 2, share / len(distances), colour, drawstyle="steps-mid",
                       linewidth=3.0 if way == "ndt-lc" else 1.0)
            spread = np.quantile(distances, 0.995) - np.quantile(distances, 0.005)
            numbers.append((f"{site}, {name}: width that holds 99 % of D", f"{100 * spread:.1f} cm",
                            PAPER_WIDTH_M.get((site, way), "")))
        sheet.name(axes, good["ndt-lc"].job.recording.says, "distance of the two links D (m)",
                   f"share, bins of {100 * step:g} cm")
        sheet.legend(axes)
    return Drawn(sheet,
                 "How the distance D between the scanner and a reference on another link of the harvester is "
                 "distributed, in bins of 10 cm. A good path keeps it within half a metre.",
                 "The distance from our path to a prism on the cabin, which a simulated total station follows. The two "
                 f"are rigidly joined here. So a perfect path gives one value and the station's noise.{words}",
                 numbers)


def jobs_of_sites(sites, ways):
    return lambda plan: {f"{site} {way}": Job(plan.recording(site), way, WAYS[way][2])
                         for site in sites for way in ways}


def by_site(runs):
    """{"site way": run} as {site: {way: run}}."""
    sites = {}
    for name, run in runs.items():
        site, way = name.split()
        sites.setdefault(site, {})[way] = run
    return sites


def batches(run, scans):
    """Time, wall and CPU milliseconds a scan, means over batches of so many scans."""
    blocks = run.told["scan_blocks"]
    count = np.array(blocks["scans"], float)
    group = np.floor((np.cumsum(count) - 1) / scans).astype(int)
    weight = np.bincount(group, count)
    mean = lambda name: np.bincount(group, count * np.array(blocks[name])) / weight
    return mean("from_s"), mean("wall_ms"), mean("cpu_ms")


def draw_times(plan, title, runs):
    sites = by_site(runs)
    part = "whole" if plan.seconds is None else f"first {plan.seconds:g} s of each"
    sheet = Sheet(f"{title}\nseed {plan.seed}, {part}", 1, 2, (9.5, 4.4), {"width_ratios": [1.6, 1]})
    course, whole = sheet.axes[0]
    numbers, words, styles = [], "", dict(zip(sites, ("-", "--", ":")))
    place = 0
    ticks = []
    for site, its_runs in sites.items():
        good, failures = good_runs(its_runs)
        words += failures
        for way, run in good.items():
            name, colour, _ = WAYS[way]
            scans = BATCH_SCANS if run.told["scans"] > 4 * BATCH_SCANS else max(1, run.told["scans"] // 10)
            times, _, cpu = batches(run, scans)
            sheet.line(course, f"{name}, {site}", times, cpu, colour, linestyle=styles[site], marker=".")
            mean = run.told["stages"]["scan"]["cpu_ms"]["mean"]
            sheet.bars(whole, f"{name}, {site}", [place], [mean], 0.8, colour)
            ticks.append(f"{site}\n{name}")
            place += 1
            wall = run.told["stages"]["scan"]["wall_ms"]["mean"]
            numbers.append((f"{site}, {name}: mean of a scan", f"{mean:.0f} ms of CPU ({wall:.0f} ms by the clock)",
                            "60 ms" if way == "ndt-lc" else ""))
    whole.set_xticks(range(place), ticks, fontsize=7, rotation=45, ha="right")
    sheet.name(course, f"means over {BATCH_SCANS} scans, or a tenth of a short run", "time (s)",
               "CPU time a scan (ms)")
    sheet.name(whole, "whole run", "", "CPU time a scan (ms)")
    course.set_ylim(bottom=0)
    sheet.legend(course, fontsize=7)
    return Drawn(sheet,
                 "The mean time to process a scan, over batches of 300 or 1,000 scans and over whole runs. NDT stays at "
                 "60 ms, and LIO-SAM grows with the map, beyond the 100 ms until the next scan.",
                 "The time from a scan to its pose and its place in the map, with NDT and with LOAM. CPU times of all "
                 f"threads are shown: times by the clock count what else the machine does.{words}",
                 numbers)


def antenna_path(run):
    """The antenna's fixes of a run, a second apart: times and degrees, and metres east, north, up of the truth."""
    fixes = read_table(run.folder / "gnss.csv", "timestamp", "latitude_deg", "longitude_deg", "height_m")
    fixes = fixes[np.isfinite(fixes).all(axis=1)]
    _, first = np.unique(np.floor(fixes[:, 0]), return_index=True)
    fixes = fixes[first]
    return fixes[:, 0], enu(fixes[:, 1], fixes[:, 2], fixes[:, 3], origin_of(run.truth))


def on_globe(run):
    """The path of a run east, north, up of the truth's origin, by the place that the run itself found; or None."""
    place = run.told["georeference"]
    if not place["on_globe"]:
        return None
    path = read_path(run.folder / "trajectory.tum")
    x, y, z, w = place["enu_from_world"]["rotation_xyzw"]
    from figures.data import Path3, moved
    rotation = Path3(np.zeros(1), np.zeros((1, 3)), np.array([[x, y, z, w]])).rotations()[0]
    origin = place["origin"]
    shift = enu(origin["latitude_deg"], origin["longitude_deg"], origin["height_m"], origin_of(run.truth))
    return moved(path, rotation, np.array(place["enu_from_world"]["translation_m"]) + shift)


def draw_fused(plan, title, runs):
    good, failures = good_runs(runs)
    some = next(iter(good.values()))
    truth = read_path(some.truth / "trajectory.tum")
    times, fixes = antenna_path(some)
    trees = read_table(some.truth / "trees.csv", "x", "y")
    low, high = truth.places[:, :2].min(axis=0) - 15, truth.places[:, :2].max(axis=0) + 15
    trees = trees[((trees > low) & (trees < high)).all(axis=1)]
    sheet = Sheet(site_title(title, some), 1, 2, (9.8, 4.8), {"width_ratios": [1.3, 1]})
    plan_view, heights = sheet.axes[0]
    sheet.dots(plan_view, "trees (truth)", *trees.T, "trees", 5)
    sheet.line(plan_view, "truth", *truth.places[:, :2].T, "truth", linewidth=3.0, alpha=0.35)
    sheet.dots(plan_view, "fixes", *fixes[:, :2].T, "fixes", 7)
    sheet.line(heights, "truth", truth.times - truth.times[0], truth.places[:, 2], "truth", linewidth=3.0, alpha=0.35)
    sheet.dots(heights, "fixes", times - truth.times[0], fixes[:, 2], "fixes", 7)
    numbers = [("heights span: fixes, truth", f"{np.ptp(fixes[:, 2]):.1f} m, {np.ptp(truth.places[:, 2]):.1f} m",
                "73 m, 10 m" if some.job.recording.site == "evo1" else "")]
    for way, run in good.items():
        name, colour, _ = FUSED if way == "fused" else ("NDT, laid on the fixes", "ours", None)
        path = on_globe(run)
        if path is None:
            failures += f" The run \"{name}\" found no place on the globe and is laid on the truth."
            name = ("NDT" if way == "ndt" else "NDT with fixes, not fused") + ", laid on the truth"
            path, _, _ = laid_on(read_path(run.folder / "trajectory.tum"), truth, upright=True)
        width = 3.0 if way == "ndt" else 1.2  # over a short stretch both are nearly the same
        sheet.line(plan_view, name, *path.places[:, :2].T, colour, linewidth=width)
        sheet.line(heights, name, path.times - truth.times[0], path.places[:, 2], colour, linewidth=width)
        i, j = paired(path.times, truth.times)
        off = path.places[i] - truth.places[j]
        numbers.append((f"{name}: off the truth in the plane and in height, RMS",
                        f"{rms(np.linalg.norm(off[:, :2], axis=1)):.2f} m, {rms(off[:, 2]):.2f} m", ""))
    sheet.name(plan_view, "from above", "east (m)", "north (m)")
    sheet.name(heights, "height", "time (s)", "up (m)")
    plan_view.set_aspect("equal", "datalim")
    sheet.legend(plan_view)
    return Drawn(sheet,
                 "Fixes, reference trees, and the paths of NDT alone and with GNSS in the graph. The fused path has a "
                 "wrong heading over its first 20 m, and fixes under trees span 73 m of height.",
                 "The same, with the simulator's truth. NDT alone is laid on the fixes as a whole by the run itself; "
                 f"the fused one is bent by them. No loops are closed.{failures}",
                 numbers)


def fused_jobs(site):
    return lambda plan: {"ndt": Job(plan.recording(site), "ndt", WAYS["ndt"][2]),
                         "fused": Job(plan.recording(site), "fused", FUSED[2])}


def draw_tuusniemi_distances(plan, title, runs):
    return draw_distances(plan, title, by_site(runs))


FIGURES = [
    *(PaperFigure(f"P4-F{number}", f"Computed trajectories, {site}", jobs_of(site, tuple(WAYS)), draw_trajectories)
      for number, site in ((14, "evo1"), (15, "evo2"), (16, "evo3"), (17, "tuusniemi1"), (18, "tuusniemi3"))),
    PaperFigure("P4-F19", "Distance to another link of the harvester",
                jobs_of_sites(("tuusniemi1", "tuusniemi3"), tuple(WAYS)), draw_tuusniemi_distances),
    PaperFigure("P4-F21", "Time to process a scan",
                jobs_of_sites(("evo2", "evo3", "tuusniemi1"), ("ndt-lc", "loam")), draw_times),
    PaperFigure("P4-F22", "GNSS beside the trajectories, evo1", fused_jobs("evo1"), draw_fused),
    PaperFigure("P4-F23", "GNSS beside the trajectories, evo2", fused_jobs("evo2"), draw_fused),
]
