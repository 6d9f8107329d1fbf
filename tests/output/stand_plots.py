"""Figures by sample plot through the program: `understory inventory --plots` and `--plot-grid`.

A stand with known stems is made as a cloud. What is written is compared with the stems, and read by
GDAL's SQLite. Plots that do not fit end with the right exit code, and nothing is left behind.
"""

import csv
import json
import math
import os
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import numpy as np

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
BENCHMARK = str(Path(__file__).resolve().parents[2] / "benchmarks" / "stand_table.py")
EAST, NORTH = 500_000.0, 6_900_000.0  # of the cloud's south-west corner
SIDE = 30.0
STEPS = np.arange(2.5, SIDE, 5.0)  # a stem every 5 m
LIMIT = 0.02  # of a figure, relative


def stems():
    """x, y, diameter and height."""
    return [(x, y, 0.16 + 0.004 * i + 0.01 * j, 15.0) for i, x in enumerate(STEPS) for j, y in enumerate(STEPS)]


def make_cloud(path):
    random = np.random.default_rng(3)
    ground = random.uniform(0.0, SIDE, (int(SIDE * SIDE * 100), 2))
    parts = [np.column_stack([ground, random.normal(0.0, 0.02, len(ground))])]
    for x, y, dbh, height in stems():
        z = random.uniform(0.1, 4.0, 1500)
        turn = random.uniform(0.0, 2.0 * np.pi, len(z))
        radius = 0.5 * dbh - 0.008 * (z - 1.3) + random.normal(0.0, 0.006, len(z))
        parts.append(np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn), z]))
        z = random.uniform(4.0, height, 600)
        crown = random.normal(0.0, 0.25, (len(z), 2))
        parts.append(np.column_stack([x + crown[:, 0], y + crown[:, 1], z]))
    points = np.concatenate(parts) + [EAST, NORTH, 100.0]
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = [EAST, NORTH, 0.0], [0.001] * 3
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    cloud.write(path)


def inventory(cloud, run, *words):
    return subprocess.run([PROGRAM, "--quiet", "inventory", str(cloud), "-o", str(run), "--set", "extent=basic",
                           *map(str, words)], capture_output=True, text=True)


def rows(path):
    with open(path, newline="") as file:
        return {row["plot"]: row for row in csv.DictReader(file)}


def near(row, name, expected):
    assert abs(float(row[name]) / expected - 1.0) < LIMIT, (name, row[name], expected)


def check_figures(folder, cloud):
    plots = folder / "plots.csv"
    plots.write_text(f"id,x,y,radius_m\nA,{EAST + 15},{NORTH + 15},9\nB,{EAST + 27},{NORTH + 15},9\n")
    run = folder / "run"
    done = inventory(cloud, run, "--plots", plots, "--plot-grid", 10, "--crs", "EPSG:3067", "--set", "stand.species=pine")
    assert done.returncode == 0, done.stderr
    found = rows(run / "plots.csv")
    assert len(found) == 1 + 2 + 9, list(found)
    near(found["seen"], "seen_m2", SIDE * SIDE)
    near(found["seen"], "stems_per_ha", 36 / 0.09)
    on_plot = [s for s in stems() if math.hypot(s[0] - 15, s[1] - 15) < 9]
    assert int(found["A"]["trees"]) == len(on_plot)
    assert float(found["A"]["seen_share"]) > 0.99
    near(found["A"], "stems_per_ha", len(on_plot) / (math.pi * 81) * 1e4)
    near(found["A"], "basal_area_m2_per_ha", sum(math.pi / 4 * s[2] ** 2 for s in on_plot) / (math.pi * 81) * 1e4)
    assert float(found["A"]["national_volume_m3_per_ha"]) > 10.0
    assert found["A"]["volume_m3_per_ha"] == "", "no stem curves in a basic inventory"
    # A segment of the circle lies beyond the cloud.
    beyond = 81 * math.acos(3 / 9) - 3 * math.sqrt(81 - 9)
    assert abs(float(found["B"]["seen_share"]) - (1 - beyond / (math.pi * 81))) < 0.02
    cell = found[f"{EAST + 10:.0f}_{NORTH + 10:.0f}"]
    near(cell, "stems_per_ha", 400)
    document = json.loads((run / "run.json").read_text())
    assert "plots" in {w["key"] for w in document["warnings"]}
    assert document["counts"]["plots"] == 11
    near(document["quality"], "stems_per_ha", 400)
    assert {"plots.csv", "plot_classes.csv"} <= set(document["files"])
    with sqlite3.connect(run / "trees.gpkg") as layers:
        assert layers.execute("select count(*) from plots").fetchone() == (11,)
        assert layers.execute("select srs_id from gpkg_contents where table_name = 'plots'").fetchone() == (3067,)
    assert "Stand figures" in (run / "report.html").read_text()


def check_refusals(folder, cloud):
    geojson = folder / "plots.geojson"
    geojson.write_text(json.dumps({"type": "FeatureCollection", "features": [{
        "type": "Feature", "properties": {"radius_m": 9.0}, "geometry": {"type": "Point", "coordinates": [27.0, 62.2]}}]}))
    files = {"empty": "id,x,y,radius_m\n", "nan": "id,x,y,radius_m\nA,nan,2,9\n",
             "radius": f"id,x,y,radius_m\nA,{EAST},{NORTH},0\n", "columns": "id,x,y\nA,1,2\n",
             "reserved": f"id,x,y,radius_m\nseen,{EAST + 9},{NORTH + 9},9\n"}
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text)
    for words, code, message in [
            (["--plots", folder / "none.gpkg"], 3, "no such file"),
            (["--plots", folder / "empty.csv"], 3, "it holds none"),
            (["--plots", folder / "nan.csv"], 3, "line 2"),
            (["--plots", folder / "radius.csv"], 3, "radius_m over 0"),
            (["--plots", folder / "columns.csv"], 3, "radius_m"),
            (["--plots", f"{EAST},{NORTH},-1"], 3, "radius_m over 0"),
            (["--plots", "10,20,9"], 3, "the plot lies outside of it"),
            (["--plots", "10,20,9", "--set", "tiles.size_m=30"], 3, "the plot lies outside of it"),
            (["--plots", folder / "reserved.csv"], 3, "expected another id"),
            (["--plots", ""], 2, "--plots"), (["--plots", " "], 2, "--plots"), (["--plot-grid", ""], 2, "--plot-grid"),
            (["--plots", geojson], 3, "names no coordinate system"),
            (["--plots", f"{EAST},{NORTH},9", "--slice"], 2, "--slice"),
            (["--plot-grid", "-5"], 2, "stand.grid_m"), (["--plot-grid", "0.001"], 2, "expected cells of 1 to 1000 m")]:
        run = folder / "refused"
        done = inventory(cloud, run, *words)
        assert done.returncode == code and message in done.stderr, (words, done.returncode, done.stderr)
        assert not run.exists() or not any(run.iterdir()), (words, list(run.iterdir()))
    done = inventory(cloud, folder / "corner", "--plots", f"{EAST},{NORTH},9")
    assert done.returncode == 4 and "has no figures" in done.stderr, (done.returncode, done.stderr)
    # Beside what was seen, and yet in the box of the cloud: the inventory is kept, as by `map`.
    lone = laspy.read(cloud)
    lone.points = lone.points[(lone.x < EAST + 15) | (lone.y < NORTH + 15)]
    lone.write(folder / "l.las")
    done = inventory(folder / "l.las", folder / "beside", "--plots", f"{EAST + 25},{NORTH + 25},4")
    assert done.returncode == 4 and "(0 % of plot 1)" in done.stderr, (done.returncode, done.stderr)
    assert (folder / "beside" / "trees.csv").read_text().count("\n") > 20
    corner = rows(folder / "corner" / "plots.csv")["1"]
    assert abs(float(corner["seen_share"]) - 0.25) < 0.02 and corner["stems_per_ha"] == ""


def check_benchmark_frame(folder):
    """benchmarks/stand_table.py --plots: a run on the globe has its plots where its layers are."""
    run, turned = folder / "run", folder / "turned"
    turned.mkdir()
    (turned / "trees.gpkg").write_bytes((run / "trees.gpkg").read_bytes())
    with open(run / "trees.csv", newline="") as file:
        trees = list(csv.DictReader(file))
    scale, turn = 0.9997, np.exp(0.4j)
    world = {t["id"]: (complex(float(t["x"]), float(t["y"])) - EAST - 1j * NORTH) / (scale * turn) for t in trees}
    for tree in trees:
        tree["x"], tree["y"] = f"{world[tree['id']].real:.3f}", f"{world[tree['id']].imag:.3f}"
    with open(turned / "trees.csv", "w", newline="") as file:
        table = csv.DictWriter(file, trees[0].keys())
        table.writeheader()
        table.writerows(trees)
    for place in (run, turned):
        at = 15 + 12j if place == turned else 15 + 12j + EAST + 1j * NORTH
        (place / "trajectory.tum").write_text(f"0 {at.real} {at.imag} 0 0 0 0 1\n")
        said = subprocess.run([sys.executable, BENCHMARK, "--plots", str(place)], capture_output=True, text=True, check=True)
        row = said.stdout.splitlines()[1].split(",")
        wanted = EAST + 1j * NORTH + ((15 + 12j) * scale * turn if place == turned else 15 + 12j)
        assert abs(complex(float(row[1]), float(row[2])) - wanted) < 0.01, (row, wanted)
    check_benchmark_errors(folder, turned, trees, world)


def check_benchmark_errors(folder, turned, trees, world):
    """benchmarks/stand_table.py RUN TRUTH: plots.csv lies in the frame of trees.csv, not in that of the layers."""
    places = [world[t["id"]] for t in trees]
    middle = sum(places) / len(places)
    radius = max(abs(place - middle) for place in places) + 1.0
    with open(turned / "plots.csv", "w") as file:
        names = ["stems_per_ha", "basal_area_m2_per_ha", "mean_dbh_m", "weighted_dbh_m", "weighted_height_m",
                 "dominant_height_m", "volume_m3_per_ha"]
        sds = ["stems_per_ha_sd", "basal_area_sd_m2_per_ha", "mean_dbh_sd_m", "weighted_dbh_sd_m", "weighted_height_sd_m",
               "dominant_height_sd_m", "volume_sd_m3_per_ha"]
        print("kind", "x", "y", "radius_m", "seen_share", *names, *sds, sep=",", file=file)
        stems = 1.1 * len(trees) / (np.pi * radius ** 2 / 1e4)  # a tenth too many
        print("circle", middle.real, middle.imag, radius, 1.0, stems, *[1.0] * 6, 0.05 * stems, *[1.0] * 6, sep=",", file=file)
    truth = folder / "told"
    truth.mkdir()
    with open(truth / "trees.csv", "w") as file:
        print("x,y,z,dbh_m,height_m,stem_volume_m3", file=file)
        for place in places:
            print(place.real, place.imag, 0.0, 0.2, 15.0, 0.3, sep=",", file=file)
    said = subprocess.run([sys.executable, BENCHMARK, str(turned), str(truth)], capture_output=True, text=True, check=True)
    assert "| stems_per_ha | 1 | +10.0 % | 10.0 % | 1.82 |" in said.stdout, said.stdout


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cloud = folder / "stand.las"
        make_cloud(cloud)
        check_figures(folder, cloud)
        check_benchmark_frame(folder)
        check_refusals(folder, cloud)


if __name__ == "__main__":
    main()
