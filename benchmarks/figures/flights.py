"""P2, LiDAR-odometry based UAV pose estimation in young forest environment: figures 3 to 7."""

import numpy as np

from figures.paper_figure import PaperFigure
from figures.data import laid_on, layer_path, off_by, paired, read_cloud, read_path, read_table, rms
from figures.drawing import Drawn, Sheet, cells_of, shown_part
from figures.runs import Job, settings

# Loops would move what was estimated before, and the paper shows estimates as they were made.
REALTIME = settings("loop_closure.enabled=false")
NO_GNSS = (("gnss.enabled", "false"),)
PAPER_APE_M = {"lohja1": 0.2471, "lohja2": 0.3123}
PAPER_RPE_M = {"lohja1": 0.1521, "lohja2": 0.2646}
PAPER_VELOCITY = {"lohja1": (0.0945, 0.0794, 0.0706), "lohja2": (0.1310, 0.1180, 0.0556)}
NUMBER = {"lohja1": 1, "lohja2": 2}


def centimetres(metres):
    return "not known" if metres is None else f"{100 * metres:.2f} cm"


def flight(site):
    mapped = REALTIME if site == "lohja1" else REALTIME + settings("map.enabled=false")  # F3 shows one map
    return lambda plan: {"run": Job(plan.recording(site, NO_GNSS, "nognss"), "odometry", mapped)}


def draw_map(plan, title, runs):
    run = runs["run"]
    points = read_cloud(run.folder / "map.laz")
    path = layer_path(run.folder / "trees.gpkg")
    extent = shown_part(points)
    sheet = Sheet(f"{title}\n{run.job.recording.says}", 2, 1, (7.5, 8.2), {"height_ratios": [3.4, 1]})
    above, side = sheet.axes[:, 0]
    image = sheet.raster(above, "highest point", cells_of(points, extent, 0.25), extent, cmap="viridis")
    sheet.figure.colorbar(image, ax=above, label="height (m)", shrink=0.8)
    sheet.line(above, "path", *path[:, :2].T, "second")
    middle = float(np.median(path[:, 1] if len(path) else points[:, 1]))
    slab = points[np.abs(points[:, 1] - middle) < 2.0]
    heights = [extent[0], extent[1], float(points[:, 2].min()) - 0.5, float(np.quantile(points[:, 2], 0.9999)) + 0.5]
    sheet.raster(side, "points of a slab of 4 m", cells_of(slab[:, [0, 2, 1]], heights, 0.15, "count"), heights,
                 cmap="Greys", vmax=4)
    near = np.abs(path[:, 1] - middle) < 2.0
    sheet.dots(side, "path", path[near, 0], path[near, 2], "second", 5)
    sheet.name(above, "from above", "x (m)", "y (m)")
    sheet.name(side, f"from the side, y = {middle:.0f} m", "x (m)", "z (m)")
    sheet.legend(above)
    above.grid(False)
    area = np.isfinite(cells_of(points, extent, 1.0)).sum()
    return Drawn(sheet,
                 "A map of the young stand along trajectory 1, put together of the local maps of the real-time run.",
                 "The map of the same flight's run without loops and without GNSS: small pines, taller trees at the "
                 "edge, and the path between.",
                 [("points of the map", f"{run.told['counts'].get('map_points', len(points)):,}", ""),
                  ("area with points", f"{area:,} m²", ""),
                  ("path", f"{run.told['quality']['length_m']:.0f} m", "")])


def draw_path(plan, title, runs):
    run = runs["run"]
    site = run.job.recording.site
    truth = read_path(run.truth / "trajectory.tum")
    path, _, _ = laid_on(read_path(run.folder / "trajectory.tum"), truth)
    sheet = Sheet(f"{title}\n{run.job.recording.says}", 1, 2, (9.5, 4.4))
    above, axes_view = sheet.axes[0]
    start = truth.times[0]
    sheet.line(above, "reference (truth)", *truth.places[:, :2].T, "truth", linewidth=3.0, alpha=0.35)
    sheet.line(above, "estimate, lidar and IMU", *path.places[:, :2].T, "ours")
    above.set_aspect("equal", "datalim")
    i, j = paired(path.times, truth.times)
    off = 100 * (path.places[i] - truth.places[j])
    for k, (axis, colour) in enumerate(zip("xyz", ("ours", "second", "third"))):
        sheet.line(axes_view, axis, path.times[i] - start, off[:, k], colour, linewidth=1.0)
    sheet.name(above, "from above", "x (m)", "y (m)")
    sheet.name(axes_view, "estimate minus reference", "time (s)", "error (cm)")
    sheet.legend(above)
    sheet.legend(axes_view)
    errors = run.errors("se3")
    rpe = errors["rpe"][0]
    _, distances = off_by(path, truth)
    return Drawn(sheet,
                 f"The estimated trajectory {NUMBER[site]} by lidar and IMU beside a reference by low-cost RTK.",
                 "The estimate as it was made (no loops, no GNSS) beside the simulator's truth. One rigid motion lays it "
                 "on the truth, as evo does. The right side shows what the eye cannot see on the left.",
                 [("APE, RMS", f"{100 * rms(distances):.2f} cm", f"{100 * PAPER_APE_M[site]:.0f} cm"),
                  (f"RPE over {rpe['delta_m']:g} m, RMS", centimetres(rpe["translation_rmse_m"]),
                   f"{100 * PAPER_RPE_M[site]:.0f} cm"),
                  ("flight", f"{truth.length_m():.0f} m", "")])


def draw_velocity(plan, title, runs):
    run = runs["run"]
    site = run.job.recording.site
    truth_path = read_path(run.truth / "trajectory.tum")
    _, rotation, _ = laid_on(read_path(run.folder / "trajectory.tum"), truth_path)
    ours = read_table(run.folder / "states.csv.gz", "timestamp", "vx", "vy", "vz")
    true = read_table(run.truth / "velocity.csv", "timestamp", "vx", "vy", "vz")
    velocity = ours[:, 1:] @ rotation.T
    i, j = paired(ours[:, 0], true[:, 0])
    errors = [rms(velocity[i, k] - true[j, k + 1]) for k in range(3)]
    sheet = Sheet(f"{title}\n{run.job.recording.says}", 3, 1, (8.0, 6.4), {"sharex": True})
    for k, (axes, axis) in enumerate(zip(sheet.axes[:, 0], "xyz")):
        sheet.line(axes, "reference (truth)", true[:, 0] - true[0, 0], true[:, k + 1], "truth", linewidth=2.6,
                   alpha=0.35)
        sheet.line(axes, "estimate", ours[:, 0] - true[0, 0], velocity[:, k], "ours", linewidth=0.9)
        sheet.name(axes, f"{axis}: RMS error {100 * errors[k]:.2f} cm/s", "time (s)" if k == 2 else "",
                   f"v{axis} (m/s)")
    sheet.legend(sheet.axes[0, 0], loc="upper right")
    return Drawn(sheet,
                 f"The estimated velocity in x, y and z along trajectory {NUMBER[site]}, beside that of an RTK receiver.",
                 "The velocity of each scan's state, turned into the axes of the truth, beside the true velocity.",
                 [(f"RMS error in {axis}", f"{100 * ours:.2f} cm/s", f"{100 * paper:.1f} cm/s")
                  for axis, ours, paper in zip("xyz", errors, PAPER_VELOCITY[site])])


FIGURES = [
    PaperFigure("P2-F3", "Map made along trajectory 1", flight("lohja1"), draw_map),
    PaperFigure("P2-F4", "Estimated trajectory 1", flight("lohja1"), draw_path),
    PaperFigure("P2-F5", "Estimated trajectory 2", flight("lohja2"), draw_path),
    PaperFigure("P2-F6", "Estimated velocity, trajectory 1", flight("lohja1"), draw_velocity),
    PaperFigure("P2-F7", "Estimated velocity, trajectory 2", flight("lohja2"), draw_velocity),
]
