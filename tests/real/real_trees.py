"""`understory georeference --method trees` on three real stands.

- chablais3: trees measured in the field are found in an airborne cloud of 9 points per square metre.
- treematching_prf025: trees measured in the field are found among those of a mobile scanner.
- spanner: the cloud of a mobile scanner, moved up to 30 m and to any heading, is brought back to the
  airborne cloud by its trees and the terrain alone, within 0.8 m in the plane. 0.3 m in height is
  reached in 19 of 20 starts, of which four are tried here. The pose that both come with is itself 0.2 to 0.6 m off. By stems alone,
  without the canopy, the plane is off by 1.15 m.
"""

import csv
import json
import math
import os
import random
import sqlite3
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import numpy as np

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
DATA = Path(os.environ.get("UNDERSTORY_DATA", "missing"))
CHABLAIS = DATA / "chablais3"
FIELD = DATA / "treematching_prf025"
SPANNER = DATA / "spanner_mls_uas_als"
STARTS = 4  # of the cloud that is moved
LIST_STARTS = 3  # of a list of trees that is moved


def program(*arguments):
    return subprocess.run([PROGRAM, "--quiet", *map(str, arguments)], capture_output=True, text=True,
                          check=False)


def rows_of(path):
    with open(path, encoding="utf-8") as file:
        return list(csv.DictReader(file))


def number(text):
    try:
        return float(text)
    except ValueError:
        return float("nan")


class Motion:
    """A turn about the vertical and a shift."""

    def __init__(self, yaw, shift, middle):
        self.yaw, self.shift, self.middle = yaw, np.asarray(shift), np.asarray(middle)

    def __call__(self, points):
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        off = points - self.middle
        turned = np.column_stack([c * off[:, 0] - s * off[:, 1], s * off[:, 0] + c * off[:, 1],
                                  off[:, 2]])
        return turned + self.shift


def start(seed, middle):
    draw = random.Random(seed)
    length, direction = 30.0 * math.sqrt(draw.random()), draw.uniform(0, 2 * math.pi)
    return Motion(draw.uniform(-math.pi, math.pi),
                  (length * math.cos(direction), length * math.sin(direction), draw.uniform(-20, 20)),
                  middle)


def write_run(folder, places, heights, diameters):
    folder.mkdir()
    lines = ["id,x,y,z,dbh_m,height_m"]
    for k, (place, height, diameter) in enumerate(zip(places, heights, diameters)):
        cells = [f"{v:.4f}" if math.isfinite(v) else "" for v in (*place, diameter, height)]
        lines.append(f"{k + 1}," + ",".join(cells))
    (folder / "trees.csv").write_text("\n".join(lines) + "\n")
    x, y, z = np.median(places, axis=0)
    (folder / "trajectory.tum").write_text("".join(
        f"{t}.0 {x + t:.3f} {y:.3f} {z + 1.5:.3f} 0 0 0 1\n" for t in range(3)))
    (folder / "run.json").write_text('{"command": "map", "status": "complete", "reasons": []}')
    return folder


def placed(path):
    """x, y, z of the points of trees.gpkg."""
    with sqlite3.connect(path) as base:
        blobs = [row[0] for row in base.execute("select geom from trees order by fid")]
    return np.array([struct.unpack_from("<ddd", blob, len(blob) - 24) for blob in blobs])


def found(run, tree_map, result, *more):
    done = program("georeference", run, "--method", "trees", "--tree-map", tree_map, "-o", result,
                   "--json", *more)
    assert done.returncode in (0, 4), (done.returncode, done.stderr)
    return done.returncode == 0, json.loads(done.stdout)


def starts_of(name, folder, places, heights, diameters, tree_map, limit_m, between_m, *more):
    """From several starts; where the trees end, and the offset from the places they came with."""
    ends, trusted = [], 0
    for seed in range(LIST_STARTS):
        run = write_run(folder / f"{name}{seed}", start(seed, places.mean(axis=0))(places), heights,
                        diameters)
        sure, told = found(run, tree_map, folder / f"{name}{seed}_out", *more)
        trusted += sure
        ends.append(placed(folder / f"{name}{seed}_out" / "trees.gpkg"))
    offsets = np.array([(end - places).mean(axis=0) for end in ends])
    away = np.array([np.linalg.norm((end - places)[:, :2], axis=1).mean() for end in ends])
    between = max(np.linalg.norm((a - b)[:, :2], axis=1).max() for a in ends for b in ends)
    print(f"{name}: trusted {trusted} of {LIST_STARTS}; {told['trees_paired']} of {len(places)} trees paired, "
          f"{told['trees_apart_rms_m']:.2f} m apart; off by {away.max():.2f} m in plane, "
          f"{np.abs(offsets[:, 2]).max():.2f} m in height; ends within {between:.3f} m; "
          f"chance {told['trees_chance']:.2g}")
    assert trusted == LIST_STARTS and away.max() < limit_m and between < between_m, name
    return told, offsets


def chablais(folder):
    rows = rows_of(CHABLAIS / "tree_inventory_chablais3.rda.tree_inventory_chablais3.csv")
    places = np.array([(float(r["x"]), float(r["y"]), 1350.0) for r in rows])
    heights = [number(r["h"]) for r in rows]
    diameters = [0.01 * number(r["d"]) for r in rows]
    told, _ = starts_of("chablais3", folder, places, heights, diameters,
                        CHABLAIS / "las_chablais3.laz", 2.0, 0.1, "--tree-map-crs", "EPSG:2154", "--crs",
                        "EPSG:2154")
    assert told["trees_paired"] >= 40, told


def field(folder):
    rows = [r for r in rows_of(FIELD / "PRF025_Field.rda.PRF025_Field.csv") if r["Status"] == "L"]
    places = np.array([(float(r["Field_Xpj"]), float(r["Field_Ypj"]), 0.0) for r in rows])
    tree_map = folder / "lidar.csv"
    lines = ["x,y,z,dbh_m,height_m"]
    for r in rows_of(FIELD / "PRF025_Lidar.rda.PRF025_Lidar.csv"):
        lines.append(f"{r['X']},{r['Y']},{r['Z']},{r['DBH']},{r['TH']}")
    tree_map.write_text("\n".join(lines) + "\n")
    told, _ = starts_of("prf025", folder, places, [number(r["Ht"]) for r in rows],
                        [0.01 * number(r["DBH"]) for r in rows], tree_map, 2.0, 0.1, "--tree-map-crs",
                        "EPSG:26918", "--crs", "EPSG:26918")
    assert told["trees_paired"] >= 40, told


def mobile_to_airborne(folder):
    def inventory(cloud, result):
        done = program("inventory", cloud, "-o", result)
        assert done.returncode in (0, 4), done.stderr
        trees = rows_of(result / "trees.csv")
        return (np.array([[float(t[k]) for k in "xyz"] for t in trees]),
                [number(t["height_m"]) for t in trees], [number(t["dbh_m"]) for t in trees])

    places, heights, diameters = inventory(SPANNER / "MLS_Clip.laz", folder / "mls")
    _, offsets = starts_of("spanner", folder, places, heights, diameters, SPANNER / "ALS_Clip.laz",
                           1.3, 0.15, "--tree-map-crs", "EPSG:26912", "--crs", "EPSG:26912")
    # The heights of trees below others' crowns are their own: the airborne cloud has no such top, so fewer tops agree.
    # With the crown above, one start ended within 0.000 m of the others and 0.38 m off in height. Now it is 0.126 and 0.46 m.
    assert np.abs(offsets[:, 2]).max() < 0.5, offsets
    # The cloud itself is moved and its trees and tops are found anew; the ground of the airborne cloud
    # is the terrain model.
    done = program("inventory", SPANNER / "ALS_Clip.laz", "-o", folder / "als")
    assert done.returncode in (0, 4), done.stderr
    ends, trusted = [], 0
    for seed in range(100, 100 + STARTS):
        end, sure, told = brought_back(seed, places, folder)
        ends.append(end)
        trusted += sure
    off = np.array(ends) - guides(places)
    between = max(np.linalg.norm((a - b)[:, :2], axis=1).max() for a in ends for b in ends)
    plane, height = np.linalg.norm(off[:, :, :2], axis=2).mean(axis=1), np.abs(off[:, :, 2].mean(axis=1))
    print(f"spanner, cloud moved, by {told['method']}, {told['trees_by']}: trusted {trusted} of {STARTS}; off by "
          f"{plane.max():.2f} m in plane, {height.max():.2f} m in height; ends within {between:.3f} m")
    assert trusted == STARTS and plane.max() < 0.8 and np.median(height) < 0.3 and height.max() < 0.45, (plane, height)


def guides(places):
    """Places on a bow over the plot, a path that can be told from the result."""
    x, y, z = places.mean(axis=0)
    return np.array([[x + 10 * math.cos(0.2 * k), y + 8 * math.sin(0.2 * k), z + 1.5] for k in range(16)])


def path_of(path):
    """x, y, z of the points of the path in trees.gpkg."""
    with sqlite3.connect(path) as base:
        blob, = base.execute("select geom from path").fetchone()
    size = {0: 0, 1: 32, 2: 48, 3: 48, 4: 64}[(blob[3] >> 1) & 7]
    kind, count = struct.unpack_from("<II", blob, 8 + size + 1)
    assert kind in (1002, 2 + 0x80000000), kind
    return np.array(struct.unpack_from(f"<{3 * count}d", blob, 8 + size + 9)).reshape(count, 3)


def brought_back(seed, places, folder):
    """The cloud after a motion, its inventory, and where auto lays the path that moved with it."""
    cloud = laspy.read(SPANNER / "MLS_Clip.laz")
    moved = laspy.LasData(laspy.LasHeader(point_format=0, version="1.2"))
    moved.header.scales = [0.001] * 3
    motion = start(seed, places.mean(axis=0))
    moved.x, moved.y, moved.z = motion(np.column_stack([cloud.x, cloud.y, cloud.z])).T
    moved.write(folder / "moved.laz")
    run = folder / f"moved{seed}"
    done = program("inventory", folder / "moved.laz", "-o", run)
    assert done.returncode in (0, 4), done.stderr
    (run / "trajectory.tum").write_text("".join(
        f"{t}.0 {x:.4f} {y:.4f} {z:.4f} 0 0 0 1\n" for t, (x, y, z) in enumerate(motion(guides(places)))))
    done = program("georeference", run, "--method", "auto", "--tree-map", SPANNER / "ALS_Clip.laz", "--tree-map-crs",
                   "EPSG:26912", "--dem", folder / "als" / "dtm.tif", "--crs", "EPSG:26912", "-o",
                   folder / f"back{seed}", "--json")
    assert done.returncode in (0, 4), (done.returncode, done.stderr)
    return path_of(folder / f"back{seed}" / "trees.gpkg"), done.returncode == 0, json.loads(done.stdout)


if not DATA.is_dir():
    sys.exit(77)
with tempfile.TemporaryDirectory() as scratch:
    failed = []
    for case in (chablais, field, mobile_to_airborne):
        try:
            (Path(scratch) / case.__name__).mkdir()
            case(Path(scratch) / case.__name__)
        except AssertionError as error:
            failed.append(f"{case.__name__}: {error}")
            print("FAILED", failed[-1])
    assert not failed, failed
