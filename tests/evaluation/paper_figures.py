"""`./run accuracy --figures` (benchmarks/paper_figures.py) on tiny runs. Figures hold the values of the
runs, a second call makes no run again, and wrong requests are refused. The geometry behind the figures
is tested, too."""

import contextlib
import csv
import gzip
import io
import json
import os
import sys
import tempfile
from pathlib import Path

import numpy as np

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "benchmarks"))

import paper_figures  # noqa: E402
from figures import strip_roads, walks  # noqa: E402
from figures.catalogue import all_figures  # noqa: E402
from figures.data import Path3, enu, laid_on, moved, off_by, paired, read_path, rigid_fit  # noqa: E402
from figures.page import Entry, markdown  # noqa: E402
from figures.paper_figure import Plan  # noqa: E402
from figures.runs import Job, Recording, Run, Runs  # noqa: E402
from program import understory_json  # noqa: E402

# A figure of each kind that a few seconds can show.
TINY = ["P2-F3", "P2-F4", "P2-F6", "P3-F7", "P4-F15"]
SECONDS = 8.0  # a path that turns: else velocities have no axes
LIGHT = ["--set", "lidar.keep_every=2", "--set", "stand.trees_per_ha=300"]


def check(condition, what):
    if not condition:
        sys.exit(f"paper_figures: {what}")


def called(*words):
    """Exit status of the command, and what it said on standard error."""
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
        try:
            code = paper_figures.main(list(map(str, words)))
        except SystemExit as end:
            code = end.code
    return code, said.getvalue()


def geometry():
    random = np.random.default_rng(1)
    places = random.normal(size=(50, 3)) * [20, 20, 2]
    turns = random.normal(size=(50, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    path = Path3(np.arange(50) * 0.1, places, turns)
    angle = 0.7
    rotation = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(0.4), -np.sin(0.4)], [0, np.sin(0.4), np.cos(0.4)]])
    tilted = moved(path, rotation @ about_x, np.zeros(3))
    check(np.allclose(tilted.rotations(), rotation @ about_x @ path.rotations()), "attitudes tilt along, too")
    other = moved(path, rotation, np.array([3.0, -1.0, 2.0]))
    check(np.allclose(other.rotations(), rotation @ path.rotations()), "attitudes turn along with their path")
    for upright in (False, True):
        back, _, _ = laid_on(path, other, upright)
        check(off_by(back, other)[1].max() < 1e-9, "a path that was moved is laid on where it was")
    tilted = rigid_fit(places, places @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]).T, upright=True)[0]
    check(np.allclose(tilted[2], [0, 0, 1]), "an upright fit does not tilt")
    i, j = paired(np.array([0.0, 0.1, 0.25]), np.array([0.001, 0.098, 0.3]))
    check(list(i) == [0, 1] and list(j) == [0, 1], "poses are paired with the nearest within the tolerance")
    # A second of latitude and of longitude on the GRS 80 ellipsoid at 60 degrees north.
    away = enu(60 + 1 / 3600, 25.0, 10.0, (60.0, 25.0, 10.0))
    check(abs(away[1] - 30.948) < 2e-3 and abs(away[0]) < 1e-6, f"a second of latitude is {away}")
    away = enu(60.0, 25 + 1 / 3600, 12.0, (60.0, 25.0, 10.0))
    check(abs(away[0] - 15.500) < 2e-3 and abs(away[2] - 2.0) < 1e-3, f"a second of longitude is {away}")


def means_of_batches():
    run = Run.__new__(Run)
    run.told = {"scan_blocks": {"from_s": [0, 1, 2, 3], "scans": [10, 10, 10, 5], "wall_ms": [1, 3, 5, 8],
                                "cpu_ms": [2, 6, 10, 16], "map_size": [0, 1, 2, 3]}}
    _, wall, cpu = walks.batches(run, 20)
    check(np.allclose(wall, [2, 6]) and np.allclose(cpu, [4, 12]), f"means over batches of scans: {wall} {cpu}")


def orientations(folder):
    """F10 of P1 of a made-up run: 40 trees that lean by known angles, seen from ten places by a body that turns."""
    random = np.random.default_rng(2)
    leans = np.radians(random.normal(size=(40, 2)) * [1.0, 3.0] + [0.5, 0.0])
    axes = np.column_stack([np.tan(leans), np.ones(40)])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    feet = np.column_stack([np.arange(40) % 8 * 4.0, np.arange(40) // 8 * 4.0, np.zeros(40)])
    run, truth = folder / "run", folder / "truth"
    run.mkdir()
    truth.mkdir()
    poses, stems = [], ["frame,timestamp,x,y,z,axis_x,axis_y,axis_z"]
    for view in range(10):
        angle, place = 0.3 * view, np.array([2.0 * view, 1.0, 1.5])
        body = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        poses.append(f"{view} {place[0]} {place[1]} {place[2]} 0 0 {np.sin(angle / 2)} {np.cos(angle / 2)}")
        for k in range(40):
            sign = -1 if (view + k) % 2 else 1  # an axis has no direction
            cells = [*((feet[k] - place) @ body), *(sign * axes[k] @ body)]
            stems.append(f"{view},{view}," + ",".join(f"{cell:.9f}" for cell in cells))
    (run / "trajectory.tum").write_text("\n".join(poses) + "\n")
    with gzip.open(run / "stems.csv.gz", "wt") as file:
        file.write("\n".join(stems) + "\n")
    (run / "trees.csv").write_text("x,y\n" + "".join(f"{x},{y}\n" for x, y, _ in feet))
    (run / "run.json").write_text(json.dumps({"quality": {"axis_noise_deg": 0.5}}))
    (truth / "trees.csv").write_text("x,lean_deg\n" + "".join("0,2.0\n" for _ in feet))
    job = Job(Recording("lieksa2", 3), "stems")
    drawn = strip_roads.draw_orientations(None, "t", {"run": Run(job, run, truth)})
    told = {row[0]: row[1] for row in drawn.numbers}
    sd = np.degrees(np.arctan(np.tan(leans))).std(axis=0)
    check(told["trees"] == "40" and told["standard deviation towards x, y"] == f"{sd[0]:.1f}°, {sd[1]:.1f}°", f"F10: {told}")
    check(told["noise over the views, of each of two directions"] == "0.0°", f"F10 of stems without noise: {told}")
    drawn.sheet.save(folder, "P1-F10")
    check(len(rows_of(folder, "P1-F10")) == 40 + 48, "F10 has all trees and all bars")


def rows_of(folder, key):
    with open(folder / f"{key}.csv", encoding="utf-8") as text:
        return list(csv.DictReader(text))


def values_are_those_of_the_runs(folder):
    plan = Plan(3, SECONDS, folder, (("lidar.keep_every", "2"), ("stand.trees_per_ha", "300")))
    run = Runs(folder).get(all_figures()["P2-F4"].jobs(plan)["run"])
    told = understory_json("evaluate", run.folder, run.truth, "--align", "se3")
    error = [row for row in rows_of(folder, "P2-F4") if row["axes"] == "estimate minus reference"]
    square = sum((0.01 * float(row["y"])) ** 2 for row in error) / (len(error) / 3)
    check(abs(square ** 0.5 - told["ape_rmse_m"]) < 1e-4, f"errors of F4: {square ** 0.5}, by evaluate {told['ape_rmse_m']}")
    numbers = [row[1] for row in json.loads((folder / "P2-F6.json").read_text())["numbers"]]
    wanted = [f"{100 * value:.2f} cm/s" for value in told["velocity_rmse_m_s"]]
    check(numbers == wanted, f"F6 says {numbers}, evaluate {wanted}")
    poses = len(read_path(run.folder / "trajectory.tum").times)
    shown = [row for row in rows_of(folder, "P2-F4") if row["series"].startswith("estimate")]
    check(len(shown) == poses, f"F4 shows {len(shown)} of {poses} poses")


def tiny_figures(folder):
    words = ["-o", folder, "--seconds", SECONDS, *LIGHT, "--only", ",".join(TINY)]
    code, said = called(*words)
    check(code == 0, f"exit status {code}: {said}")
    page = (folder / "index.html").read_text()
    check(page.count("data:image/png;base64,") == len(TINY), "the page holds all pictures")
    for key in TINY:
        check((folder / f"{key}.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n", f"{key}.png is a picture")
        table = folder / f"{key}.csv"
        check(table.exists() or table.with_suffix(".csv.gz").exists(), f"{key} has its values")
        if table.exists():
            check(len(rows_of(folder, key)) > 10, f"{key} shows more than a few values")
        told = json.loads((folder / f"{key}.json").read_text())
        check("seed 3, first 8 s" in told["recordings"] and "nan" not in str(told["numbers"]),
              f"{key} says {told}")
    values_are_those_of_the_runs(folder)
    sizes = [float(row["y"]) for row in rows_of(folder, "P3-F7") if row["y_is"] == "points (million)"]
    check(sizes[0] == 0.0 and 1e-3 < max(sizes) < 10.0, f"the local map grows: {sizes}")
    made = {file: file.stat().st_mtime_ns for file in folder.glob("runs/*/run.json")}
    check(not list(folder.glob("recordings/*.mcap")), "recordings are removed")
    code, said = called(*words)
    check(code == 0 and "recording" not in said, f"runs that are there are not made again: {said}")
    check(made == {file: file.stat().st_mtime_ns for file in folder.glob("runs/*/run.json")}, "runs stay as they are")


def pages_keep_other_figures():
    entry = lambda key, words: Entry(key, "t", "r", "p", words, [("a", "1", "")], f"{key}.png", f"{key}.csv")
    keys = ["P2-F4", "P2-F6", "P4-F21"]
    old = markdown([entry("P2-F4", "first"), entry("P4-F21", "second")], "pictures", keys)
    new = markdown([entry("P2-F6", "third"), entry("P4-F21", "fourth")], "pictures", keys, old)
    at = [new.find(word) for word in ("first", "third", "fourth")]
    check(-1 < at[0] < at[1] < at[2] and "second" not in new, f"a page that gets two figures: {new}")
    check(markdown([], "pictures", keys, new) == new, "a page stays as it is where no figure is new")


def wrong_use(folder):
    for words, wanted in ((["--only", "P9-F1"], "unknown figure"), (["--seconds", "0"], "1 to"),
                          (["--set", "lidar"], "KEY=VALUE"), (["--seed", "0"], "1 or more")):
        code, said = called("-o", folder / "none", *words)
        check(code == 2 and wanted in said and not (folder / "none").exists(), f"{words}: {code} {said}")
    (folder / "file").write_text("")
    code, said = called("-o", folder / "file", "--only", "P2-F4")
    check(code == 3 and "cannot be written" in said, f"a file in place of the folder: {code} {said}")
    code, said = called("-o", folder / "key", "--only", "P2-F4", "--set", "lidar.nonsense=1")
    check(code == 3 and "lidar.nonsense" in said, f"a key that no site has: {code} {said}")


def main():
    os.environ["MPLCONFIGDIR"] = tempfile.mkdtemp()
    geometry()
    means_of_batches()
    pages_keep_other_figures()
    with tempfile.TemporaryDirectory() as scratch:
        orientations(Path(scratch))
        wrong_use(Path(scratch))
        tiny_figures(Path(scratch) / "figures")
    print("figures are drawn")


if __name__ == "__main__":
    main()
