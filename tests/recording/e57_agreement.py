"""The program reads E57 files that the Python package pye57 writes. The trees of a plot are the same
from E57 as from PLY. One scan has double precision and a pose, the other one scaled integers of 20 bits
and points that are marked as invalid. A third one, by pye57's own defaults, has single precision: its
trees are nearly the same."""

import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import numpy as np
import pye57
from pye57 import libe57

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import simulated

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
TURN = np.radians(35.0)
SHIFT = np.array([120.0, -40.0, 2.5])  # of the first scan's frame in the file's


def run(*words, expected=0):
    done = subprocess.run([PROGRAM, "--quiet", *map(str, words)], capture_output=True, text=True)
    assert done.returncode == expected, (words, done.returncode, done.stderr)
    return done.stderr


def trees(folder):
    with (folder / "trees.csv").open() as table:
        return np.array([[float(row[key]) for key in ("x", "y", "dbh_m", "height_m")]
                         for row in csv.DictReader(table) if row["dbh_m"] and row["height_m"]])


def write_ply(path, points):
    head = "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{}end_header\n".format(
        len(points), "".join(f"property double {axis}\n" for axis in "xyz"))
    path.write_bytes(head.encode() + points.astype("<f8").tobytes())


def in_own_frame(points):
    c, s = np.cos(TURN), np.sin(TURN)
    return (points - SHIFT) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def add_plain_scan(file, points):
    """By pye57's defaults: single precision, with colours and intensities."""
    own, counter = in_own_frame(points), np.arange(len(points))
    file.write_scan_raw({"cartesianX": own[:, 0], "cartesianY": own[:, 1], "cartesianZ": own[:, 2],
                         "intensity": counter % 200.0, "colorRed": counter % 256, "colorGreen": counter % 256,
                         "colorBlue": counter % 256},
                        name="single precision", translation=SHIFT,
                        rotation=np.array([np.cos(TURN / 2), 0, 0, np.sin(TURN / 2)]))


def add_scan(file, name, prototype, columns, pose=None):
    image = file.image_file
    scan = libe57.StructureNode(image)
    scan.set("guid", libe57.StringNode(image, "{" + name + "}"))
    scan.set("name", libe57.StringNode(image, name))
    if pose is not None:
        scan.set("pose", pose)
    vector = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
    scan.set("points", vector)
    file.data3d.append(scan)
    count = len(next(iter(columns.values())))
    arrays, buffers = file.make_buffers(list(columns), count)
    for column, values in columns.items():
        arrays[column][:] = values
    writer = vector.writer(buffers)
    writer.write(count)
    writer.close()


def add_double_scan(file, points):
    """Double precision, in the scanner's own frame."""
    image, own = file.image_file, in_own_frame(points)
    prototype = libe57.StructureNode(image)
    for axis in "XYZ":
        prototype.set(f"cartesian{axis}", libe57.FloatNode(image, 0.0, libe57.E57_DOUBLE))
    pose = libe57.StructureNode(image)
    for part, names, values in (("rotation", "wxyz", (np.cos(TURN / 2), 0.0, 0.0, np.sin(TURN / 2))),
                                ("translation", "xyz", SHIFT)):
        node = libe57.StructureNode(image)
        pose.set(part, node)
        for name, value in zip(names, values):
            node.set(name, libe57.FloatNode(image, float(value)))
    add_scan(file, "double precision", prototype, {f"cartesian{axis}": own[:, k] for k, axis in enumerate("XYZ")}, pose)


def add_scaled_scan(file, points):
    """Tenths of a millimetre from -52 m on; every seventh point is invalid and lies elsewhere. Returns the others."""
    image = file.image_file
    invalid = np.arange(len(points)) % 7 == 0
    columns = {f"cartesian{axis}": np.where(invalid, 1.0, points[:, k]) for k, axis in enumerate("XYZ")}
    columns["cartesianInvalidState"] = invalid.astype(np.int8) * 2
    prototype = libe57.StructureNode(image)
    for axis in "XYZ":
        prototype.set(f"cartesian{axis}", libe57.ScaledIntegerNode(image, 0, -520_000, 520_000, 1e-4, 0.0))
    prototype.set("cartesianInvalidState", libe57.IntegerNode(image, 0, 0, 2))
    add_scan(file, "scaled integers", prototype, columns)
    return points[~invalid]


with tempfile.TemporaryDirectory() as scratch:
    room = Path(scratch)
    walk = simulated("demo", 3, 8, "lidar.columns=512", "stand.size_x_m=40", "stand.size_y_m=40", "stand.trees_per_ha=400")
    run("map", walk, "-o", room / "run")
    points = laspy.read(room / "run" / "map.laz").xyz
    points = points - np.round(np.median(points, axis=0))  # they are in a coordinate system
    points = points[np.abs(points).max(axis=1) < 50.0]
    path = room / "plot.e57"
    file = pye57.E57(str(path), mode="w")
    half = len(points) // 2
    add_double_scan(file, points[:half])
    kept = add_scaled_scan(file, points[half:])
    file.close()

    write_ply(room / "plot.ply", np.concatenate([points[:half], kept]))
    run("inventory", "--set", "extent=basic", room / "plot.ply", "-o", room / "from_ply")
    run("inventory", "--set", "extent=basic", path, "-o", room / "from_e57")
    want, got = trees(room / "from_ply"), trees(room / "from_e57")
    assert len(want) == len(got) > 10, (len(want), len(got))
    # Coordinates differ by their rounding, so a point may fall into the cube beside. A weak stem then has other draws.
    off = np.abs(want - got).max(axis=1)
    assert (off > 1e-3).mean() < 0.02 and off.max() < 0.1, np.sort(off)[-5:]
    print(f"{len(points)} points, {len(got)} trees: the same")

    plain = pye57.E57(str(room / "plain.e57"), mode="w")
    add_plain_scan(plain, np.concatenate([points[:half], kept]))
    plain.close()
    run("inventory", "--set", "extent=basic", room / "plain.e57", "-o", room / "from_plain")
    assert abs(len(trees(room / "from_plain")) - len(want)) < 0.05 * len(want)

    whole = path.read_bytes()
    (room / "cut.e57").write_bytes(whole[: len(whole) // 2])
    said = run("inventory", "--set", "extent=basic", room / "cut.e57", "-o", room / "none", expected=3)
    assert "the file ends before it" in said and not (room / "none").exists(), said
    flipped = bytearray(whole)
    flipped[len(whole) // 4] ^= 1
    (room / "flipped.e57").write_bytes(flipped)
    said = run("inventory", "--set", "extent=basic", room / "flipped.e57", "-o", room / "rest", expected=4)
    assert "a checksum is wrong" in said, said
    said = run("map", path, "-o", room / "none", expected=3)
    assert "understory inventory" in said and not (room / "none").exists(), said
