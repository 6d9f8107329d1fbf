"""P1, Navigation and Mapping in Forest Environment Using Sparse Point Clouds: figures 9 and 10."""

import json

import numpy as np
from matplotlib.patches import Ellipse
from scipy.spatial import cKDTree

from figures.paper_figure import PaperFigure
from figures.data import (Path3, enu, laid_on, list_in_site, moved, off_by, opened, origin_of, paired, read_path,
                          read_table, rms)
from figures.drawing import COLOURS, Drawn, Sheet
from figures.road_jobs import ROADS, WAYS, road_job
from figures.runs import reason_of
from program import DONE, UNTRUSTED, Failed, understory

COLOUR_OF = {"stems": "ours", "loam": "second"}
SAME_TREE_M = 0.5  # a stem of a view belongs to the listed tree within this
FEWEST_VIEWS = 5  # of a tree whose mean axis counts


def road_jobs(plan):
    return {f"{site} {way}": road_job(plan.recording(site), way) for site in ROADS for way in WAYS}


def on_fixes(run, antenna):
    """The path laid on the fixes by (6), east, north, up of the truth's origin; and the fit's figures. Raises Failed."""
    placed = run.folder.with_name(run.folder.name + "_gnss")
    if not (placed / "run.json").exists():
        understory("georeference", run.folder, "--method", "gnss-path", "--gnss", run.folder / "gnss.csv",
                   "--antenna-m", *antenna, "-o", placed, "--overwrite", accept=(DONE, UNTRUSTED))
    told = json.loads((placed / "run.json").read_text())
    origin = told["georeference"]["origin"]
    shift = enu(origin["latitude_deg"], origin["longitude_deg"], origin["height_m"], origin_of(run.truth))
    return moved(read_path(placed / "trajectory.tum"), np.eye(3), shift), told["quality"]


def fixes_of(run):
    rows = read_table(run.folder / "gnss.csv", "latitude_deg", "longitude_deg", "height_m")
    rows = rows[np.isfinite(rows).all(axis=1)]
    return enu(*rows.T, origin_of(run.truth))


def draw_roads(plan, title, runs):
    some = runs["lieksa1 stems"].job.recording
    part = "whole roads" if some.seconds is None else f"first {some.seconds:g} s of each"
    sheet = Sheet(f"{title}\nlieksa1 to lieksa3, seed {plan.seed}, {part}", 3, 1, (9.0, 9.0))
    found, errors, shapes, remarks = *({way: [] for way in WAYS} for _ in range(3)), ""
    for site, axes in zip(ROADS, sheet.axes[:, 0]):
        stems = runs[f"{site} stems"]
        truth = read_path(stems.truth / "trajectory.tum")
        sheet.line(axes, "truth", *truth.places[:, :2].T, "truth", linewidth=4.0, alpha=0.3)
        fixed = next((run for way in WAYS if not (run := runs[f"{site} {way}"]).failed), None)
        if fixed is not None:
            sheet.dots(axes, "fixes", *fixes_of(fixed)[:, :2].T, "fixes", 7)
        antenna = list_in_site(stems.truth, "gnss", "mount_m")
        for way, (name, _) in WAYS.items():
            run = runs[f"{site} {way}"]
            if run.failed:
                remarks += f" {site} {name}: no path ({run.failed})."
                continue
            try:
                path, figures = on_fixes(run, antenna)
                found[way].append(figures["gnss_fixes_mean_m"])
            except Failed as error:
                path, _, _ = laid_on(read_path(run.folder / "trajectory.tum"), truth, upright=True)
                remarks += f" {site} {name} is laid on the truth: {reason_of(error).split(';')[0]}."
            sheet.line(axes, name, *path.places[:, :2].T, COLOUR_OF[way])
            flat, ground = (Path3(p.times, p.places * [1, 1, 0], p.turns) for p in (path, truth))
            errors[way].append(rms(off_by(flat, ground)[1]))
            shapes[way].append(rms(off_by(laid_on(flat, ground, upright=True)[0], ground)[1]))
        sheet.name(axes, site, "east (m)", "north (m)")
        axes.set_aspect("equal", "datalim")
    sheet.legend(sheet.axes[0, 0])
    several = lambda values: ", ".join(f"{value:.2f} m" for value in values) or "not known"
    return Drawn(sheet,
                 "The paths by GNSS, by stems (sSLAM) and by LeGO-LOAM (LLOAM) along the strip roads, both laid on the "
                 "fixes by (6).",
                 "The same by our front end by stems and by our LOAM with ground, beside the simulator's truth, from above. "
                 f"Fixes are off by metres for minutes, and so is what is laid on them.{remarks}",
                 [(f"fixes off the path, mean: {WAYS[way][0]}, roads 1 to 3", several(found[way]), "0.8 m")
                  for way in WAYS]
                 + [(f"path off the truth in the plane, RMS: {WAYS[way][0]}", several(errors[way]), "") for way in WAYS]
                 + [(f"the same, laid on the truth instead: {WAYS[way][0]}", several(shapes[way]), "") for way in WAYS])


def axis_table(run):
    """Stems of all views in the world: feet (n, 3) and directions (n, 3), upwards."""
    stems = read_table(run.folder / "stems.csv.gz", "timestamp", "x", "y", "z", "axis_x", "axis_y", "axis_z")
    path = read_path(run.folder / "trajectory.tum")
    i, j = paired(stems[:, 0], path.times)
    rotations = path.rotations()[j]
    feet = np.einsum("nij,nj->ni", rotations, stems[i, 1:4]) + path.places[j]
    axes = np.einsum("nij,nj->ni", rotations, stems[i, 4:7])
    axes *= np.sign(axes[:, 2:])
    return feet, axes / np.linalg.norm(axes, axis=1, keepdims=True)


def leans(axes):
    """Degrees from the vertical towards x and y."""
    return np.degrees(np.arctan2(axes[:, :2], axes[:, 2:]))


def mean_axes(run):
    """Mean direction of each tree that enough views show, and the angle of each of its stems from it, degrees."""
    feet, axes = axis_table(run)
    trees = read_table(run.folder / "trees.csv", "x", "y")
    far, tree = cKDTree(trees).query(feet[:, :2], distance_upper_bound=SAME_TREE_M)
    feet, axes, tree = feet[np.isfinite(far)], axes[np.isfinite(far)], tree[np.isfinite(far)]
    sums = np.zeros((len(trees), 3))
    np.add.at(sums, tree, axes)
    views = np.bincount(tree, minlength=len(trees))
    means = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12)
    enough = views >= FEWEST_VIEWS
    shown = enough[tree]
    angles = np.degrees(np.arccos(np.clip((axes[shown] * means[tree[shown]]).sum(axis=1), -1, 1)))
    return means[enough], angles


def draw_orientations(plan, title, runs):
    run = runs["run"]
    means, angles = mean_axes(run)
    if not len(means):
        raise ValueError(f"no tree is seen in {FEWEST_VIEWS} views")
    lean = leans(means)
    centre, spread = lean.mean(axis=0), lean.std(axis=0)
    with opened(run.truth / "trees.csv") as text:
        head = text.readline().strip().split(",")
    true = read_table(run.truth / "trees.csv", "lean_deg")[:, 0] if "lean_deg" in head else np.array([])
    sheet = Sheet(f"{title}\n{run.job.recording.says}", 1, 2, (9.5, 4.6))
    scatter, histogram = sheet.axes[0]
    sheet.dots(scatter, f"mean axis of a tree ({len(lean)} trees)", *lean.T, "ours", 9, alpha=0.6)
    for times in (1, 2):
        scatter.add_patch(Ellipse(centre, *(2 * times * spread), fill=False, color=COLOURS["second"], lw=1.4,
                                  label="1 and 2 standard deviations" if times == 1 else None))
    reach = float(max(4.0, np.quantile(np.abs(lean), 0.995) + 1))
    scatter.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    edges = np.arange(0, 12.25, 0.25)
    share, _ = np.histogram(np.clip(angles, 0, 11.9), edges)
    sheet.bars(histogram, f"stems of single views ({len(angles):,})", edges[:-1] + 0.125,
               share / max(1, len(angles)), 0.25, "ours")
    sheet.name(scatter, "deviation from the vertical of the map", "towards x (degrees)", "towards y (degrees)")
    sheet.name(histogram, "angle from the mean axis of the same tree", "angle (degrees)", "share")
    sheet.legend(scatter)
    sheet.legend(histogram)
    noise = run.told["quality"].get("axis_noise_deg")
    return Drawn(sheet,
                 "The orientations of the stem segments along strip road 2, some 580 trees, as deviations from the "
                 "vertical. Their standard deviation is 2.5°, and their noise over views 2.0°.",
                 "The mean axis of each listed tree that at least five views show, in the frame of the map. The right "
                 "side shows how far the stems of single views are from it. Wind has no say here: the simulator leans "
                 "trees in all directions alike.",
                 [("trees", str(len(lean)), "580"),
                  ("standard deviation towards x, y", f"{spread[0]:.1f}°, {spread[1]:.1f}°", "2.5°"),
                  ("lean, RMS", f"{rms(np.linalg.norm(lean - centre, axis=1)):.1f}°", ""),
                  ("true lean of the stand, RMS", f"{rms(true[np.isfinite(true)]):.1f}°" if true.size else "", ""),
                  ("noise over the views, of each of two directions", f"{rms(angles) / np.sqrt(2):.1f}°", "2.0°"),
                  ("the same by the run itself", "not known" if noise is None else f"{noise:.1f}°", "2.0°")])


FIGURES = [
    PaperFigure("P1-F9", "Odometric paths of three methods", road_jobs, draw_roads),
    PaperFigure("P1-F10", "Orientations of stems along strip road 2",
                lambda plan: {"run": road_job(plan.recording("lieksa2"), "stems")}, draw_orientations),
]
