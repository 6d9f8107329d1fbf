"""map.copc.laz agrees with map.laz, as the Python packages laspy and copclib read them.

A simulated walk is mapped with `--copc`, its inventory is taken with `--copc`, and the run is laid on
the globe. Every COPC holds the points of the LAZ beside it, each once, in the cube of its node. Queries
by place and level find what a search through all points finds. The same bytes for any number of threads:
same_bytes.py.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import lazrs
import numpy as np
from laspy.copc import Bounds

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import placed_recording, simulated

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
COLUMNS = ("X", "Y", "Z", "gps_time", "intensity", "classification")
TREES = ("tree_id", "HeightAboveGround")


def call(*words):
    return subprocess.run([PROGRAM, "--quiet", *map(str, words)], capture_output=True, text=True)


def run(*words, codes=(0, 4)):
    done = call(*words)
    assert done.returncode in codes, (words, done.returncode, done.stderr)
    return done.stdout + done.stderr


def rows(points, trees=False):
    """The points, one a row, in the order of a hash of their values: to sort by the columns takes five times as long."""
    names = COLUMNS + TREES * trees
    table = np.column_stack([np.nan_to_num(np.asarray(points[name], dtype=float), nan=-1e9) for name in names]) + 0.0
    odd = np.random.default_rng(1).integers(2**62, 2**63, len(names), dtype=np.uint64) | np.uint64(1)
    bits = table.view(np.uint64)
    hashed = ((bits ^ bits >> np.uint64(32)) * odd).sum(axis=1, dtype=np.uint64)  # whole numbers have no low bits
    return table[np.argsort(hashed, kind="stable")]


def nodes_of(path):
    """The entries of the hierarchy and, for each, its points as raw coordinates in metres."""
    with laspy.CopcReader.open(str(path)) as reader:
        info, header = reader.copc_info, reader.header
        for key, entry in reader.root_page.entries.items():
            reader.source.seek(entry.offset)
            raw = reader.source.read(entry.byte_size)
            out = bytearray(entry.point_count * header.point_format.size)
            lazrs.decompress_points_with_chunk_table(raw, reader.laszip_vlr.record_data, out,
                                                     [(entry.point_count, entry.byte_size)])
            steps = np.frombuffer(out, dtype=np.dtype(
                {"names": ["xyz"], "formats": ["3<i4"], "offsets": [0], "itemsize": header.point_format.size}))["xyz"]
            bounds = key.bounds(Bounds(info.center - info.halfsize, info.center + info.halfsize))
            yield key, entry, steps * header.scales + header.offsets, bounds


def check(folder, trees):
    laz = laspy.read(folder / "map.laz")
    expected = rows(laz, trees)
    with laspy.CopcReader.open(str(folder / "map.copc.laz")) as reader:
        everything = reader.query()
        assert len(everything) == len(laz.points) == reader.header.point_count
        assert np.array_equal(rows(everything, trees), expected), folder
        wkts = [[v.string for v in h.vlrs if v.record_id == 2112] for h in (reader.header, laz.header)]
        assert wkts[0] == wkts[1], wkts
        info = reader.copc_info
        assert np.isclose(info.gps_min, laz.gps_time.min()) and np.isclose(info.gps_max, laz.gps_time.max())
        low, high = laz.xyz.min(axis=0), laz.xyz.max(axis=0)
        assert np.allclose(reader.header.mins, low, atol=1e-6) and np.allclose(reader.header.maxs, high, atol=1e-6)
        random = np.random.default_rng(3)
        found = 0
        for _ in range(12):
            corner = random.uniform(low, high)
            box = Bounds(corner, corner + random.uniform(0.05, 0.5, 3) * (high - low))
            # laspy rounds a box to whole steps.
            first, last = (np.round((end - laz.header.offsets) / laz.header.scales) for end in (box.mins, box.maxs))
            steps = np.column_stack([laz.X, laz.Y, laz.Z])
            inside = np.all((steps >= first) & (steps <= last), axis=1)
            assert len(reader.query(bounds=box)) == inside.sum(), (box, inside.sum())
            found += inside.sum()
        assert found > 100, found
        levels = sorted({key.level for key in reader.root_page.entries})
        assert levels == list(range(len(levels))), levels
        assert sum(len(reader.query(level=level)) for level in levels) == len(laz.points)
        shown = reader.query(level=0)
        assert 1000 < len(shown) < len(laz.points) / 2, "the root is a picture of all"
        spread = np.ptp(np.column_stack([shown.x, shown.y]), axis=0) / np.ptp(laz.xyz[:, :2], axis=0)
        assert np.all(spread > 0.9), spread
    keys = set()
    for key, entry, points, bounds in nodes_of(folder / "map.copc.laz"):
        assert entry.point_count > 0
        assert np.all(points >= bounds.mins) and np.all(points <= bounds.maxs), key
        keys.add((key.level, key.x, key.y, key.z))
    for level, *place in keys:
        assert level == 0 or (level - 1, *(at // 2 for at in place)) in keys
    with laspy.open(folder / "map.copc.laz") as plain:  # as LAZ from one end to the other
        assert np.array_equal(rows(plain.read(), trees), expected)
    return len(laz.points), len(keys), len(levels)


def check_by_copclib(path, points):
    """copclib, where it is installed: it reads every node, and all points lie within the bounds of their nodes."""
    try:
        import copclib
    except ImportError:
        return "copclib is not installed"
    reader = copclib.FileReader(str(path))
    nodes = reader.GetAllNodes()
    assert sum(node.point_count for node in nodes) == points
    assert sum(len(reader.GetPoints(node)) for node in nodes) == points
    assert reader.ValidateSpatialBounds(verbose=False)
    return f"{len(nodes)} nodes by copclib"


def check_our_reader(folder, laz_points):
    found = json.loads(run("info", folder / "map.copc.laz", "--json"))
    assert str(laz_points) in json.dumps(found), found
    lists = []
    for name in ("map.laz", "map.copc.laz"):
        at = folder.parent / f"of-{name}"
        run("inventory", folder / name, "-o", at, "--set", "extent=basic")
        lists.append([line.split(",")[:6] for line in (at / "trees.csv").read_text().splitlines()])
    # The order of points decides on which of two nearby ones is kept, so not to the last digit.
    # A stem at the limit may be on either side.
    assert abs(len(lists[0]) - len(lists[1])) <= 1 < 3 < len(lists[0]), [len(rows) for rows in lists]


def check_refusals(folder, walk):
    for words, said in ((("map", walk, "--front-end", "sparse"), "front-end dense"),
                        (("map", walk, "--set", "map.enabled=false"), "map.enabled"),
                        (("inventory", folder / "run/map.laz", "--set", "extent=basic"), "extent=full"),
                        (("inventory", folder / "run/map.laz", "--slice"), "--slice")):
        done = call(*words, "--copc", "-o", folder / "refused")
        assert done.returncode == 2 and said in done.stderr, (words, done.returncode, done.stderr)
        assert not (folder / "refused").exists()
    said = run("inventory", folder / "placed", "--copc", "-o", folder / "stand")
    assert (folder / "stand/map.copc.laz").exists(), said
    degrees = run("georeference", folder / "run", "--method", "gnss-path", "--crs", "EPSG:4979", "-o", folder / "degrees")
    facts = json.loads((folder / "degrees/run.json").read_text())
    assert "map.copc.laz" in degrees and "copc.degrees" in json.dumps(facts["warnings"]), degrees
    assert (folder / "degrees/map.laz").exists() and not (folder / "degrees/map.copc.laz").exists()


with tempfile.TemporaryDirectory() as room:
    folder = Path(room)
    walk = placed_recording()
    run("map", walk, "-o", folder / "run", "--copc")
    print("map:", check(folder / "run", trees=False))
    facts = json.loads((folder / "run/run.json").read_text())
    assert "map.copc.laz" in facts["files"] and facts["frames"]["map.copc.laz"] == facts["frames"]["map.laz"]
    assert "./map.copc.laz" in (folder / "run/map.qgs").read_text()
    run("inventory", folder / "run/map.laz", "-o", folder / "cloud", "--copc")
    points = check(folder / "cloud", trees=True)
    print("inventory:", points, check_by_copclib(folder / "cloud/map.copc.laz", points[0]))
    run("georeference", folder / "run", "--method", "gnss-path", "-o", folder / "placed")
    print("georeference:", check(folder / "placed", trees=False))
    check_our_reader(folder / "run", facts["counts"]["map_points"])
    check_refusals(folder, walk)
