"""A full inventory through the program: stem curves, volumes, crowns, and the tree of each point.

A simulated walk is mapped with `--inventory full`. The inventory of the map is then made once more, as
of a run and as of a cloud. What is written is compared with the truth of the simulation, and read by
laspy and GDAL's SQLite.
"""

import csv
import json
import os
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import simulated

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
SECTION_RMSE_M = 0.014  # of sections that were measured, to 6 m of height, to 8 m from the path
VOLUME_BIAS = 0.06  # of the sum over the trees to 8 m from the path


def run(*words):
    done = subprocess.run([PROGRAM, "--quiet", *map(str, words)], capture_output=True, text=True)
    assert done.returncode == 0, (words, done.returncode, done.stderr)
    return done.stdout


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def number(text):
    return float(text) if text else float("nan")


def curves(path):
    found = {}
    for row in rows(path):
        found.setdefault(int(row["tree_id"]), []).append(
            [number(row[name]) for name in ("height_m", "diameter_m", "x", "y")] + [number(row.get("measured", "1"))])
    return {tree: np.array(sections) for tree, sections in found.items()}


def into_truth(folder, truth):
    """The turn about the vertical and the shift that lay the list on the truth."""
    found = json.loads(run("evaluate", "trees", folder, truth, "--align", "yaw", "--json"))["alignment_found"]
    turn = np.radians(found["yaw_deg"])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return lambda place: rotation @ place + np.array(found["translation_m"][:2])


def pairs(folder, truth):
    """Trees of the list near the path with those of the truth at the same place."""
    laid = into_truth(folder, truth)
    path = np.loadtxt(truth / "trajectory.tum")[:, 1:3]
    listed, true = rows(folder / "trees.csv"), rows(truth / "trees.csv")
    places = np.array([[float(row["x"]), float(row["y"])] for row in true])
    for row in listed:
        place = laid(np.array([float(row["x"]), float(row["y"])]))
        gaps = np.linalg.norm(places - place, axis=1)
        j = int(gaps.argmin())
        if gaps[j] < 0.4 and np.linalg.norm(path - places[j], axis=1).min() < 8.0:
            yield row, true[j]


def check_curves(folder, truth):
    own, right = curves(folder / "stem_curves.csv"), curves(truth / "stem_curves.csv")
    errors, volumes, true_volumes = [], [], []
    for tree, grown in pairs(folder, truth):
        sections, there = own[int(tree["id"])], right[int(grown["id"])]
        heights = sections[:, 0]
        assert heights[0] == 0.0 and np.all(np.diff(heights) > 0.0), heights
        assert np.all(sections[:, 1] >= 0.0)
        low = (sections[:, 4] == 1) & (heights > 0.3) & (heights < 6.0)
        errors.extend(sections[low, 1] - np.interp(heights[low], there[:, 0], there[:, 1]))
        if tree["stem_volume_m3"]:
            assert abs(heights[-1] - float(tree["height_m"])) < 0.06, (heights[-1], tree)
            volumes.append(float(tree["stem_volume_m3"]))
            true_volumes.append(float(grown["stem_volume_m3"]))
    assert len(volumes) >= 15, len(volumes)
    rmse = float(np.sqrt(np.mean(np.square(errors))))
    bias = sum(volumes) / sum(true_volumes) - 1.0
    assert len(errors) > 300 and rmse < SECTION_RMSE_M, (len(errors), rmse)
    assert abs(bias) < VOLUME_BIAS, bias
    return rmse, bias


def check_cloud(folder, truth, points):
    """map.laz: each point's tree and height. A measured stem's points are its own."""
    las = laspy.read(folder / "map.laz")
    assert len(las.points) == points, (len(las.points), points)
    owner = np.asarray(las["tree_id"])
    height = np.asarray(las["HeightAboveGround"])
    ids = {int(row["id"]) for row in rows(folder / "trees.csv")}
    assert set(np.unique(owner).tolist()) <= ids | {0}
    assert np.all(owner[np.asarray(las.classification) == 2] == 0), "ground belongs to no tree"
    xyz = np.asarray(las.xyz)
    own = curves(folder / "stem_curves.csv")
    right = wrong = 0
    for tree, grown in pairs(folder, truth):
        sections = own[int(tree["id"])][10:60:5]
        reach = np.abs(xyz[:, :2] - sections[:, 2:4].mean(axis=0)).max(axis=1)
        around = np.flatnonzero(reach < 2.0 + np.ptp(sections[:, 2:4], axis=0).max())
        for height_m, diameter, x, y, measured in sections:
            if measured != 1:
                continue
            near = around[(np.abs(height[around] - height_m) < 0.05) &
                          (np.hypot(xyz[around, 0] - x, xyz[around, 1] - y) < 0.55 * diameter + 0.02)]
            right += int(np.sum(owner[near] == int(tree["id"])))
            wrong += int(np.sum(owner[near] != int(tree["id"])))
    assert right > 2000 and wrong < 0.02 * right, (right, wrong)
    return right, wrong


def check_crowns(folder, truth):
    """Crowns with a base, and those with an area: seen from all sides. Areas are those of the truth."""
    bases, ratios = 0, []
    for tree, grown in pairs(folder, truth):
        if not tree["crown_base_m"] or not tree["height_m"]:
            continue
        bases += 1
        base, top = float(tree["crown_base_m"]), float(tree["height_m"])
        assert 0.0 <= base < top, tree
        assert bool(tree["crown_area_m2"]) == bool(tree["crown_volume_m3"]), tree
        if not tree["crown_area_m2"]:
            continue
        area, volume = float(tree["crown_area_m2"]), float(tree["crown_volume_m3"])
        assert 0.1 < area < 60.0 and 0.0 < volume < area * (top - base) + 1.0, tree
        if grown["crown_area_m2"]:
            ratios.append(area / float(grown["crown_area_m2"]))
    assert bases >= 15 and len(ratios) >= 8 and 0.7 < np.median(ratios) < 1.3, (bases, ratios)
    return bases, len(ratios), float(np.median(ratios))


def check_foreign_clouds(run_map, folder):
    """A clip of the map as others write it: times of the GPS week, intensities up to 1, a point astray."""
    clip = run_map.xyz[np.abs(run_map.xyz[:, :2] - np.median(run_map.xyz[:, :2], axis=0)).max(axis=1) < 8.0]
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = [0.001] * 3, clip.min(axis=0)
    las = laspy.LasData(header)
    las.xyz = clip
    las.gps_time = 1000.0 + 0.25 * np.arange(len(clip))
    assert las.header.global_encoding.gps_time_type == laspy.header.GpsTimeType.WEEK_TIME
    las.write(folder / "week.las")
    run("inventory", folder / "week.las", "-o", folder / "week")
    again = laspy.read(folder / "week/map.laz")
    assert again.header.global_encoding.gps_time_type == laspy.header.GpsTimeType.WEEK_TIME
    assert np.array_equal(again.gps_time, las.gps_time)

    stray = np.vstack([clip, [[1e9, 5.0, 5.0]]])
    with open(folder / "stray.ply", "w") as file:
        file.write(f"ply\nformat ascii 1.0\nelement vertex {len(stray)}\n")
        file.write("".join(f"property double {name}\n" for name in ("x", "y", "z", "intensity")) + "end_header\n")
        for k, point in enumerate(stray):
            file.write("%.4f %.4f %.4f %.3f\n" % (*point, 0.001 * (k % 1001)))
    run("inventory", folder / "stray.ply", "-o", folder / "stray")
    again = laspy.read(folder / "stray/map.laz")
    assert len(again.points) == len(clip)
    assert again.intensity.max() == 65535 and abs(int(again.intensity[500]) - 32768) <= 1
    assert "1 points lie over" in (folder / "stray/report.html").read_text()


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        walk = simulated("handheld", 3, 16, "gnss.enabled=false", "stand.size_x_m=70", "stand.size_y_m=70", "carrier.length_m=150")
        truth = walk.with_suffix(".truth")
        run("map", walk, "-o", folder / "run", "--inventory", "full")
        points = json.loads((folder / "run/run.json").read_text())["counts"]["map_points"]
        print("map: RMSE of sections %.4f m, bias of the volume %+.3f" % check_curves(folder / "run", truth))
        print("map: points of stems right and wrong", *check_cloud(folder / "run", truth, points))
        print("map: crowns, those with an area, median ratio to the truth", *check_crowns(folder / "run", truth))
        with sqlite3.connect(folder / "run/trees.gpkg") as layer:
            assert layer.execute("select count(*) from trees where stem_volume_m3 > 0").fetchone()[0] > 15

        run("--threads", 2, "inventory", folder / "run", "-o", folder / "again")
        check_curves(folder / "again", truth)
        check_cloud(folder / "again", truth, points)
        run("inventory", folder / "run/map.laz", "-o", folder / "cloud")
        check_curves(folder / "cloud", truth)
        check_cloud(folder / "cloud", truth, points)
        # As a cloud it keeps its times and intensities.
        first, second = (laspy.read(folder / place / "map.laz") for place in ("run", "cloud"))
        assert np.array_equal(first.gps_time, second.gps_time)
        assert np.array_equal(first.intensity, second.intensity)
        assert np.allclose(first.xyz, second.xyz, atol=1e-9)

        check_foreign_clouds(first, folder)

        # A basic one has none of that, and the empty columns say so.
        run("inventory", folder / "week.las", "-o", folder / "basic", "--set", "extent=basic")
        assert rows(folder / "basic/trees.csv") and not (folder / "basic/stem_curves.csv").exists() and not (folder / "basic/map.laz").exists()
        assert all(row["stem_volume_m3"] == "" for row in rows(folder / "basic/trees.csv"))

        said = subprocess.run([PROGRAM, "map", "sim:lieksa2", "-o", str(folder / "stems"), "--front-end", "sparse",
                               "--inventory", "full"], capture_output=True, text=True)
        assert said.returncode == 2 and "--front-end dense" in said.stderr, said.stderr


if __name__ == "__main__":
    main()
