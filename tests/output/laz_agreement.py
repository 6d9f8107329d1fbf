"""LAZ files agree with the Python package laspy, both ways.

What the program writes (the map of a run, the clouds of a converted recording) is read by laspy. What
laspy writes (several point formats, scales and a coordinate system) is read by the program.
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
SHIFT = np.array([385_000.0, 6_672_000.0, 40.0])  # into the plane of ETRS89 / TM35FIN
WKT = ('PROJCS["ETRS89 / TM35FIN(E,N)",GEOGCS["ETRS89",DATUM["European_Terrestrial_Reference_System'
       '_1989",SPHEROID["GRS 1980",6378137,298.257222101]],PRIMEM["Greenwich",0],UNIT["degree",'
       '0.0174532925199433],AUTHORITY["EPSG","4258"]],PROJECTION["Transverse_Mercator"],'
       'PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",27],'
       'PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],'
       'PARAMETER["false_northing",0],UNIT["metre",1],AUTHORITY["EPSG","3067"]]')
GPS_EPOCH_S = 315_964_800 - 18 + 1_000_000_000  # adjusted standard GPS time 0, as Unix time


def run(*words):
    done = subprocess.run([PROGRAM, "--quiet", *map(str, words)], capture_output=True, text=True)
    assert done.returncode == 0, (words, done.returncode, done.stderr)
    return done.stdout


def check_map(folder):
    """The map of a run: counts, classes, times, bounds, and no invented coordinate system."""
    facts = json.loads((folder / "run.json").read_text())
    las = laspy.read(folder / "map.laz")
    header = las.header
    assert (header.version.major, header.version.minor) == (1, 4), header.version
    assert header.point_format.id == 6 and header.are_points_compressed
    assert header.point_count == len(las.points) == facts["counts"]["map_points"] > 100_000
    assert list(header.scales) == [0.001] * 3, header.scales
    assert header.global_encoding.wkt and header.global_encoding.gps_time_type == 1
    assert facts["coordinate_system"] is None and len(header.vlrs) == 0, header.vlrs  # without GNSS
    assert np.all(header.number_of_points_by_return[1:] == 0)
    low, high = las.xyz.min(axis=0), las.xyz.max(axis=0)
    assert np.allclose(low, header.mins, atol=1e-6) and np.allclose(high, header.maxs, atol=1e-6)
    classes = dict(zip(*np.unique(np.asarray(las.classification), return_counts=True)))
    assert set(classes) <= {1, 2, 3, 4, 5, 7}, classes
    assert all(classes.get(c, 0) > 100 for c in (2, 5)), classes  # ground and trees
    check_classes(las, folder)
    poses = np.loadtxt(folder / "trajectory.tum")
    unix = np.asarray(las.gps_time) + GPS_EPOCH_S
    assert poses[0, 0] - 0.2 < unix.min() and unix.max() < poses[-1, 0] + 0.2
    # Every point was seen from somewhere on the path, not farther than a lidar reaches.
    reach = np.linalg.norm(las.xyz[::100, :2] - poses[:, 1:3].mean(axis=0), axis=1)
    assert reach.max() < 200.0, reach.max()
    return las, facts


def check_classes(las, folder):
    """Vegetation classes follow the height above the nearest ground points."""
    ground = las.xyz[las.classification == 2]
    cells = {}
    for x, y, z in ground:
        cells.setdefault((int(x // 1), int(y // 1)), []).append(z)
    medians = {cell: np.median(z) for cell, z in cells.items() if len(z) > 20}
    checked = wrong = 0
    for x, y, z, kind in zip(las.x[::50], las.y[::50], las.z[::50],
                             np.asarray(las.classification)[::50]):
        base = medians.get((int(x // 1), int(y // 1)))
        if base is None or kind not in (3, 4, 5):
            continue
        height = z - base
        checked += 1
        low, high = {3: (0.0, 0.5), 4: (0.5, 2.0), 5: (2.0, 60.0)}[int(kind)]
        wrong += not low - 0.35 <= height <= high + 0.35  # the ground is not level in a cell
    assert checked > 500 and wrong < 0.01 * checked, (checked, wrong)


def check_clouds(recording, folder):
    """Clouds written as LAZ and as KITTI's plain floats hold the same points."""
    run("convert", recording, folder / "laz", "--format", "laz")
    run("convert", recording, folder / "bin", "--format", "bin")
    names = sorted((folder / "laz").glob("*.laz"))
    plain = sorted((folder / "bin").glob("*.bin"))
    assert len(names) == len(plain) > 20, (len(names), len(plain))
    for laz, kitti in list(zip(names, plain))[::10]:
        las = laspy.read(laz)
        points = np.fromfile(kitti, np.float32).reshape(-1, 4).astype(float)
        assert len(las.points) == len(points)
        assert np.abs(las.xyz - points[:, :3]).max() < 0.00051
        assert np.array_equal(np.asarray(las.intensity), np.rint(points[:, 3]).astype(int))
        span = np.asarray(las.gps_time).max() - np.asarray(las.gps_time).min()
        assert 0.09 < span < 0.1, span
    return len(names)


def check_georeferenced(las, run_folder, folder):
    """laspy moves the map into a coordinate system; the inventory of that is the moved inventory."""
    for name, kind, scale in (("six.laz", 6, 0.001), ("three.las", 3, 0.01)):
        header = laspy.LasHeader(point_format=kind, version="1.4")
        header.offsets, header.scales = np.floor(SHIFT), [scale] * 3
        header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(WKT))
        header.global_encoding.wkt = True
        header.add_extra_dim(laspy.ExtraBytesParams("beam", "uint16"))
        moved = laspy.LasData(header)
        moved.x, moved.y, moved.z = (las.xyz + SHIFT).T
        moved.intensity, moved.gps_time = las.intensity, las.gps_time
        moved.write(folder / name)
    run("inventory", run_folder, "-o", folder / "plain")
    expected = trees_of(folder / "plain")
    assert len(expected) > 20, len(expected)
    for name, limit_m in (("six.laz", 0.01), ("three.las", 0.05)):
        place = folder / (name + "-trees")
        run("inventory", folder / name, "-o", place)
        facts = json.loads((place / "run.json").read_text())
        assert "TM35FIN" in facts["coordinate_system"], facts["coordinate_system"]
        found = trees_of(place) - SHIFT[:2]
        apart = np.linalg.norm(found[:, None] - expected[None], axis=2).min(axis=1)
        # Cells and blocks begin elsewhere, so a doubtful stem may come, go or move. Which ones do depends on the
        # instruction set: 0.89 of them stayed on one machine, more on another.
        assert abs(len(found) - len(expected)) <= 0.1 * len(expected), (len(found), len(expected))
        assert np.median(apart) < limit_m and np.mean(apart < 0.1) > 0.85, apart
        with sqlite3.connect(place / "trees.gpkg") as base:
            assert set(base.execute("SELECT srs_id FROM gpkg_contents").fetchall()) == {(3067,)}
    return len(expected)


def trees_of(folder):
    with open(folder / "trees.csv", newline="") as rows:
        return np.array([[float(r["x"]), float(r["y"])] for r in csv.DictReader(rows)])


def check_points_by_laspy(folder):
    """Points of every format that laspy writes come through a conversion unchanged."""
    generator = np.random.default_rng(8)
    expected = []
    source = folder / "made"
    source.mkdir()
    for i, kind in enumerate((0, 1, 2, 3, 6, 7, 8)):
        las = laspy.create(point_format=kind, file_version="1.4" if kind > 5 else "1.2")
        las.header.scales, las.header.offsets = [0.001] * 3, [1.0, -2.0, 0.5]
        xyz = generator.uniform(-30.0, 30.0, (5_000, 3))
        las.x, las.y, las.z = xyz.T
        las.intensity = generator.integers(0, 65_536, len(xyz))
        las.write(source / f"{i:03d}.laz")
        expected.append((las.xyz, np.asarray(las.intensity)))
    run("convert", source, folder / "back", "--format", "laz", "--rate-hz", 10)
    names = sorted((folder / "back").glob("*.laz"))
    assert len(names) == len(expected), names
    for name, (xyz, intensity) in zip(names, expected):
        las = laspy.read(name)
        assert np.abs(las.xyz - xyz).max() < 0.00051, np.abs(las.xyz - xyz).max()
        assert np.array_equal(np.asarray(las.intensity), intensity)
    return len(expected)


with tempfile.TemporaryDirectory() as scratch:
    scratch = Path(scratch)
    recording = simulated("demo", 4, 8, "gnss.enabled=false", "lidar.columns=512", "stand.size_x_m=40", "stand.size_y_m=40")
    run("map", recording, "-o", scratch / "run")
    las, facts = check_map(scratch / "run")
    print("map.laz:", facts["counts"]["map_points"], "points read by laspy")
    print("clouds:", check_clouds(recording, scratch))
    print("trees of clouds in a coordinate system:",
          check_georeferenced(las, scratch / "run", scratch))
    print("point formats by laspy:", check_points_by_laspy(scratch))
