"""P3, Large-scale 3D Mapping of Subarctic Forests: figure 4, by a mapper like the paper's (registration/penalty_walk.cc)."""

import csv
import os
from pathlib import Path

import numpy as np

from figures.paper_figure import PaperFigure
from figures.data import rms
from figures.drawing import Drawn, Sheet
from program import TOP, Failed, run

PROGRAM = Path(os.environ.get("UNDERSTORY_BUILD", TOP / "build")) / "benchmarks" / "penalty_walk"
WAY_M, SHORT_WAY_M = 100, 10
SCALE = 1  # s of (8): with 30 the penalties hold the height, and neither kind holds the pitch
PRIOR_SD_DEG = 0.0  # of the increments of attitude, per root metre: the paper's IMU hardly errs over a scan
SITE = ("lidar.elevation_bias_deg=0.3", "stand.trees_per_ha=150", "lidar.snow_fall_per_m=0",
        "lidar.snow_drop_interval_s=0")
KINDS = {"prior": ("prior (GNSS, IMU)", "faint"), "none": ("ICP alone", "third"),
         "one point": ("one penalty point", "ours"), "three points": ("three penalty points", "second")}


def walk_table(plan):
    """Rows of the mapper, made once: {kind: array of way, height, pitch, true height, true pitch}."""
    way = WAY_M if plan.seconds is None or plan.seconds > 30 else SHORT_WAY_M
    file = plan.folder / "runs" / f"penalty_walk_seed{plan.seed}_{way}m_s{SCALE:g}.csv"
    if not file.exists():
        if not PROGRAM.exists():
            raise Failed(f"{PROGRAM} is not built (cmake -DUNDERSTORY_BENCHMARKS=ON)")
        done = run(PROGRAM, plan.seed, way, SCALE, PRIOR_SD_DEG, *SITE,
                   *(f"{key}={value}" for key, value in plan.keys))
        if done.code != 0:
            raise Failed(f"penalty_walk ended with {done.code}: {done.stderr.strip()[-300:]}")
        file.write_text(done.stdout)
    kinds = {}
    with open(file, encoding="utf-8") as text:
        for row in csv.DictReader(text):
            kinds.setdefault(row["penalties"], []).append(
                [float(row[name]) for name in ("way_m", "height_m", "pitch_deg", "true_height_m", "true_pitch_deg")])
    return {kind: np.array(rows) for kind, rows in kinds.items()}


def pitch_errors(rows):
    """Mean, RMS and mean over the last tenth of the error of the pitch, degrees. The first 5 m, where the map of wrong
    angles is made, are left out."""
    moving = rows[rows[:, 0] >= min(5.0, 0.5 * rows[-1, 0])]
    error = moving[:, 2] - moving[:, 4]
    return float(error.mean()), rms(error), float(error[moving[:, 0] >= 0.9 * rows[-1, 0]].mean())


def draw_penalties(plan, title, _):
    kinds = walk_table(plan)
    way = next(iter(kinds.values()))[-1, 0]
    sheet = Sheet(f"{title}\nskidoo, seed {plan.seed}, {way:.0f} m, sensor looks 0.3° higher than it says", 3, 1, (8.0, 8.0),
                  {"sharex": True})
    side, pitch, error = sheet.axes[:, 0]
    some = next(iter(kinds.values()))
    sheet.line(side, "truth", some[:, 0], some[:, 3], "truth", linewidth=3.0, alpha=0.35)
    sheet.line(pitch, "truth", some[:, 0], some[:, 4], "truth", linewidth=3.0, alpha=0.35)
    drifts = {}
    for kind, rows in kinds.items():
        name, colour = KINDS[kind]
        sheet.line(side, name, rows[:, 0], rows[:, 1], colour)
        sheet.line(pitch, name, rows[:, 0], rows[:, 2], colour, linewidth=1.0)
        sheet.line(error, name, rows[:, 0], rows[:, 2] - rows[:, 4], colour)
        drifts[kind] = pitch_errors(rows)
    sheet.name(side, "from the side", "", "height above the start (m)")
    sheet.name(pitch, "pitch of the lidar, which is mounted at -27°", "", "pitch (degrees)")
    sheet.name(error, "error of the pitch", "way (m)", "error (degrees)")
    sheet.legend(side)
    numbers = [(f"{KINDS[kind][0]}: error of the pitch from 5 m on: mean, RMS, mean of the last tenth",
                ", ".join(f"{value:.2f}°" for value in drift), "") for kind, drift in drifts.items()]
    one, three = (np.abs(drifts[kind]) for kind in ("one point", "three points"))
    numbers.append(("one point over three points, alike",
                    ", ".join(f"{ratio:.1f}" for ratio in one / np.maximum(three, 1e-6)), ""))
    return Drawn(sheet,
                 "A straight stretch from the side and its pitch. With one penalty point the path keeps to GNSS, and the "
                 "pitch rises slowly. With three points it does not.",
                 "A mapper as in section 3.3 of the paper, outside our pipeline: no IMU factor, no graph, points by ε. "
                 f"The points of a scan weigh s = {SCALE:g}. With one point the pitch drifts off for half of the "
                 "way and back. With three it stays, within the noise of the IMU. The lidar's wrong angles stand for what made the paper's pitch drift.", numbers)


FIGURES = [PaperFigure("P3-F4", "What penalty points do to the pitch", lambda plan: {}, draw_penalties)]
