"""P3, Large-scale 3D Mapping of Subarctic Forests: figures 5 and 7."""

import json

import numpy as np

from figures.paper_figure import PaperFigure
from figures.data import layer_path, read_cloud
from figures.drawing import COLOURS, Drawn, Sheet, cells_of, shown_part
from figures.runs import Job, settings
from program import DONE, UNTRUSTED, Failed, understory

SITES = ("lake", "forest", "skidoo")
NO_LOOPS = settings("loop_closure.enabled=false")
# The paper's names, and what `gnss.match.use` is for each.
CONFIGURATIONS = {"prior": "prior", "penalty": "penalty", "baseline": "none"}
INSET_M = 14.0
PAPER_MAPPER = ("registration.method=icp", "registration.icp.map_epsilon_m=0.05", "map.enabled=false",
                "loop_closure.enabled=false")
RADII = {"r_max = 100 m": ("radius100", "ours", settings(*PAPER_MAPPER, "local_map.radius_m=100")),
         "no limit": ("radius1000", "second", settings(*PAPER_MAPPER, "local_map.radius_m=1000"))}


def map_jobs(plan):
    return {f"{site} {name}": Job(plan.recording(site), name,
                                  NO_LOOPS + settings(f"gnss.match.use={use}", "map.thin_m=0.1"))
            for site in SITES for name, use in CONFIGURATIONS.items()}


def entropy_of(run):
    """Mean map entropy of map.laz, nats; None where the program cannot tell it."""
    file = run.folder.with_name(run.folder.name + "_crispness.json")
    if not file.exists():
        try:
            done = understory("evaluate", "map", run.folder, "--json", accept=(DONE, UNTRUSTED))
            file.write_text(done.stdout)
        except Failed:
            return None
    told = json.loads(file.read_text())
    return told.get("mean_entropy_nats")


def draw_one_map(sheet, axes, run, title):
    """A map from above with its path, and a window of it at full sharpness."""
    points = read_cloud(run.folder / "map.laz")
    path = layer_path(run.folder / "trees.gpkg")
    if not len(path):
        raise ValueError(f"{title}: the carrier hardly moved")
    corner = path[0]
    points, path = points - corner, path - corner
    extent = shown_part(points, margin=2.0)
    cell = max(0.25, (extent[1] - extent[0]) / 500)
    low, high = np.quantile(points[:, 2], [0.01, 0.995])
    image = sheet.raster(axes, "highest point (m)", cells_of(points, extent, cell), extent, cmap="viridis", vmin=low,
                         vmax=high)
    sheet.figure.colorbar(image, ax=axes, shrink=0.6, label="height above the start (m)")
    sheet.line(axes, "path", *path[:, :2].T, "second", linewidth=0.8)
    sheet.legend(axes, loc="lower left", fontsize=7)
    sheet.name(axes, title, "east (m)", "north (m)")
    axes.grid(False)
    middle = path[min(len(path) - 1, len(path) // 20), :2]
    inset = axes.inset_axes([0.64, 0.64, 0.35, 0.35])
    window = [middle[0] - INSET_M / 2, middle[0] + INSET_M / 2, path[0, 2] - 2.5, path[0, 2] + 8.0]
    slab = points[np.abs(points[:, 1] - middle[1]) < 1.5]
    inset.imshow(cells_of(slab[:, [0, 2, 1]], window, 0.1, "count"), origin="lower", extent=window, aspect="auto",
                 cmap="Greys", vmax=3)
    inset.set(xticks=[], yticks=[])
    for spine in inset.spines.values():
        spine.set_color(COLOURS["second"])


def draw_maps(plan, title, runs):
    some = runs["lake prior"].job.recording
    part = "whole" if some.seconds is None else f"first {some.seconds:g} s of each"
    sheet = Sheet(f"{title}\nlake, forest, skidoo, seed {plan.seed}, {part}", 3, 3, (11.0, 11.0))
    numbers, words = [], ""
    for row, site in zip(sheet.axes, SITES):
        for axes, name in zip(row, CONFIGURATIONS):
            run = runs[f"{site} {name}"]
            if run.failed or not (run.folder / "map.laz").exists():
                axes.set_axis_off()
                words += f" {site} {name}: no map."
                continue
            draw_one_map(sheet, axes, run, f"{site}, {name}")
            ape = run.errors("yaw")["ape_rmse_m"]
            entropy = entropy_of(run)
            status = "" if run.told["status"] == "complete" else f" ({run.told['status']})"
            numbers.append((f"{site}, {name}: path off the truth, and mean map entropy",
                            f"{100 * ape:.1f} cm, " + ("not known" if entropy is None else f"{entropy:.3f} nats") + status,
                            ""))
            used = run.told["counts"].get("scans_by_satellites", 0)
            if name != "baseline" and not used:
                words += f" {site} {name}: no scan was placed by satellites, so it equals the baseline."
    return Drawn(sheet,
                 "Maps of lake, forest and skidoo from above: by GNSS and IMU alone (prior), by ICP with penalties, and "
                 "by ICP alone (baseline). Insets show how crisp they are. The prior blurs, the baseline bends.",
                 "The same three of our program, without loop closure, with the receivers of the sites. The insets show "
                 f"a slab 3 m thick and {INSET_M:g} m wide from the side, near the start. Paths are laid on the truth by "
                 f"heading and place (RMS). A crisper map has a lower entropy.{words}",
                 numbers)


def radius_jobs(plan):
    return {name: Job(plan.recording("lake"), way, arguments) for name, (way, _, arguments) in RADII.items()}


def draw_radius(plan, title, runs):
    some = next(iter(runs.values()))
    sheet = Sheet(f"{title}\n{some.job.recording.says}", 1, 2, (9.5, 4.0))
    sizes, times = sheet.axes[0]
    numbers, words = [], ""
    for name, run in runs.items():
        if run.failed:
            words += f" {name}: no path ({run.failed})."
            continue
        blocks = run.told["scan_blocks"]
        colour = RADII[name][1]
        sheet.line(sizes, name, blocks["from_s"], np.array(blocks["map_size"]) / 1e6, colour)
        sheet.line(times, name, blocks["from_s"], blocks["cpu_ms"], colour)
        tenth = max(1, len(blocks["cpu_ms"]) // 10)
        # The first tenth stands still or has hardly a map, so the second is what growth is told from.
        early, late = (float(np.mean(blocks["cpu_ms"][part]))
                       for part in (slice(tenth, 2 * tenth), slice(-tenth, None)))
        if name != "no limit" and run.told["quality"]["length_m"] < 100:
            words += " This stretch is shorter than r_max, so nothing is cut yet and the curves coincide."
        numbers += [(f"{name}: points at the end", f"{blocks['map_size'][-1] / 1e6:.3f} million", ""),
                    (f"{name}: CPU a scan, second tenth and last tenth", f"{early:.0f} ms, {late:.0f} ms", "")]
    sheet.name(sizes, "points that scans are matched to", "time (s)", "points (million)")
    sheet.name(times, "time a scan", "time (s)", "CPU time a scan (ms)")
    for axes in (sizes, times):
        axes.set_ylim(bottom=0)
        sheet.legend(axes)
    return Drawn(sheet,
                 "The size of the reference cloud and the time per scan along lake, with and without the cut-map radius "
                 "of 100 m. Without it both grow over the run.",
                 "ICP to points that enter only if farther than 5 cm from all others. The local map is cut at 100 m, and "
                 f"at 1,000 m, which is all of this loop. No loops are closed.{words}",
                 numbers)


FIGURES = [
    PaperFigure("P3-F5", "Maps by prior, penalty and baseline", map_jobs, draw_maps),
    PaperFigure("P3-F7", "What the cut-map radius does", radius_jobs, draw_radius),
]
