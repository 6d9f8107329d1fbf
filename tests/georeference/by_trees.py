"""`understory georeference --method trees`: a run is found again in a map of trees by its trees alone.
Maps are CSV and GeoPackage, with and without a coordinate system, and some that will not do."""

import csv
import json
import math
import random
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program

cases = Cases()
TURN = 2.2               # of the run's frame against the map's, radians
MIDDLE = (130.0, -85.0)  # of the run in the forest
EAST, NORTH = 563200.0, 7024500.0  # of the forest's middle in ETRS-TM35FIN
HEIGHT = 140.0


def forest(seed, side=500.0, count=8000, spacing=2.2):
    """Places that keep their distance, with the height of each tree."""
    draw = random.Random(seed)
    cells, trees = {}, []
    while len(trees) < count:
        x, y = draw.uniform(-side / 2, side / 2), draw.uniform(-side / 2, side / 2)
        cell = int(x // spacing), int(y // spacing)
        near = [cells.get((cell[0] + i, cell[1] + j)) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        if any(p and math.hypot(p[0] - x, p[1] - y) < spacing for p in near):
            continue
        cells[cell] = (x, y)
        trees.append((x, y, draw.gauss(18.0, 3.0)))
    return trees


def ground(x, y):
    return HEIGHT + 0.02 * x - 0.01 * y


def from_air(trees, seed=1):
    """65 % of the trees with 0.7 m of noise along each axis, and 10 % that are none."""
    draw = random.Random(seed)
    seen = [(x + draw.gauss(0, 0.7), y + draw.gauss(0, 0.7), h + draw.gauss(0, 1.0))
            for x, y, h in trees if draw.random() < 0.65]
    return seen + [(draw.uniform(-250, 250), draw.uniform(-250, 250), 15.0)
                   for _ in range(len(seen) // 9)]


def in_run(x, y, z):
    u, v = x - MIDDLE[0], y - MIDDLE[1]
    return (math.cos(TURN) * u + math.sin(TURN) * v, -math.sin(TURN) * u + math.cos(TURN) * v,
            z - HEIGHT)


def write_run(folder, trees, most=200):
    folder.mkdir(parents=True)
    near = sorted(trees, key=lambda t: math.hypot(t[0] - MIDDLE[0], t[1] - MIDDLE[1]))[:most]
    rows = ["id,x,y,z,dbh_m,dbh_sd_m,height_m"]
    for k, (x, y, h) in enumerate(near):
        u, v, w = in_run(x, y, ground(x, y))
        rows.append(f"{k + 1},{u:.3f},{v:.3f},{w:.3f},,,{h - 1.0:.2f}")
    (folder / "trees.csv").write_text("\n".join(rows) + "\n")
    (folder / "trajectory.tum").write_text("".join(
        f"{t:.3f} {0.5 * t - 20:.3f} {5 * math.sin(t / 9):.3f} 1.5 0 0 0 1\n" for t in range(80)))
    (folder / "run.json").write_text('{"command": "map", "status": "complete", "reasons": []}')
    return folder


def write_map(path, trees, east=0.0, north=0.0, heights=True):
    rows = ["x,y,z" + (",height_m" if heights else "")]
    for x, y, h in trees:
        rows.append(f"{x + east:.3f},{y + north:.3f},{ground(x, y):.2f}" +
                    (f",{h:.2f}" if heights else ""))
    path.write_text("\n".join(rows) + "\n")
    return path


def by_trees(run, tree_map, folder, *more):
    return program("georeference", run, "--method", "trees", "--tree-map", tree_map, "-o", folder,
                   "--json", *more)


def error_m(folder, trees, frame=lambda x, y: (x, y), most=200):
    """Mean distance of the trees from their true places, in the plane, and of their feet."""
    near = sorted(trees, key=lambda t: math.hypot(t[0] - MIDDLE[0], t[1] - MIDDLE[1]))[:most]
    with (folder / "trees.csv").open() as file:
        found = [tuple(float(row[key]) for key in "xyz") for row in csv.DictReader(file)]
    true = [(*frame(x, y), ground(x, y)) for x, y, _ in near]
    plane = [math.hypot(a[0] - b[0], a[1] - b[1]) for a, b in zip(found, true)]
    return sum(plane) / len(plane), sum(a[2] - b[2] for a, b in zip(found, true)) / len(true)


FOREST = forest(1)
RUN = write_run(cases.folder / "run", FOREST)
MAP = write_map(cases.folder / "map.csv", from_air(FOREST))


@cases.case("a run is found in a map without a coordinate system, near a place and anywhere")
def local(folder):
    text = ""
    for name, more in (("near", ("--near", 20, 30)), ("any", ())):
        done = by_trees(RUN, MAP, folder / name, *more)
        assert done.returncode == 0, (done.stderr, done.stdout)
        plane, height = error_m(folder / name, FOREST)
        assert plane < 0.3 and abs(height) < 0.15, (plane, height)
        told = json.loads(done.stdout)
        assert abs(told["trees_yaw_deg"] - math.degrees(TURN)) < 0.5, told
        assert told["trees_chance"] < 1e-6 and told["trees_paired"] > 90, told
        assert 0.02 < told["sd_heading_deg"] < 0.5 and plane / 3 < 1.4 * told["sd_east_m"] < 0.5, told
        assert told["expected_error_m"] > plane / 3, told
        text += f"{name}: {plane:.2f} m, height {height:.2f} m; "
    run = json.loads((folder / "near" / "run.json").read_text())
    assert run["status"] == "complete", run
    assert any(i["file"].endswith("map.csv") for i in run["inputs"]), run["inputs"]
    return text


@cases.case("a map in a national grid puts the run on the earth, and its GeoPackage is a map, too")
def national(folder):
    grid = write_map(folder / "grid.csv", from_air(FOREST), EAST, NORTH)
    done = by_trees(RUN, grid, folder / "placed", "--tree-map-crs", "EPSG:3067", "--crs", "EPSG:3067",
                    "--near", EAST + 100, NORTH - 50)
    assert done.returncode == 0, (done.stderr, done.stdout)
    layer = folder / "placed" / "trees.gpkg"
    assert layer.stat().st_size > 10000
    again = by_trees(RUN, layer, folder / "again")
    assert again.returncode == 0, again.stderr
    told = json.loads(again.stdout)
    # Its own trees: every one has its partner.
    assert told["trees_paired"] == 200 and told["trees_apart_rms_m"] < 0.01, told
    first = json.loads(done.stdout)
    for key in ("origin_latitude_deg", "origin_longitude_deg"):
        assert abs(told[key] - first[key]) < 0.01, (told, first)
    assert 63.2 < told["origin_latitude_deg"] < 63.4 and 28.1 < told["origin_longitude_deg"] < 28.4
    return f"{first['trees_paired']} pairs, {first['trees_apart_rms_m']:.2f} m apart"


def without_ground(path, to):
    to.write_text("\n".join(",".join(row.split(",")[:2] + row.split(",")[3:])
                            for row in path.read_text().splitlines()) + "\n")
    return to


@cases.case("a map without ground leaves the heights of a run on the earth, and else says that they are local")
def heights_stay(folder):
    grid = write_map(folder / "grid.csv", from_air(FOREST), EAST, NORTH)
    bare = without_ground(grid, folder / "bare.csv")
    more = ("--tree-map-crs", "EPSG:3067", "--crs", "EPSG:3067", "--near", EAST + 100, NORTH - 50)
    done = by_trees(RUN, grid, folder / "placed", *more)
    assert done.returncode == 0, done.stderr
    done = by_trees(folder / "placed", bare, folder / "kept", *more)
    assert done.returncode == 0, done.stderr
    facts = {name: json.loads((folder / name / "run.json").read_text()) for name in ("placed", "kept")}
    feet = {}
    for name, told in facts.items():
        with (folder / name / "trees.csv").open() as file:
            heights = [float(row["z"]) for row in csv.DictReader(file)]
        feet[name] = told["georeference"]["origin"]["height_m"] + sum(heights) / len(heights)
    assert abs(feet["kept"] - feet["placed"]) < 0.05 and feet["kept"] > 100, feet
    assert facts["kept"]["georeference"]["heights"] == facts["placed"]["georeference"]["heights"], facts
    done = by_trees(RUN, bare, folder / "local", *more)
    told = json.loads((folder / "local" / "run.json").read_text())
    assert "georeference.local_heights" in [w["key"] for w in told["warnings"]], told["warnings"]
    assert "above the origin of the run" in told["georeference"]["heights"], told["georeference"]
    done = by_trees(folder / "local", bare, folder / "again", *more)
    again = json.loads((folder / "again" / "run.json").read_text())
    assert again["georeference"]["heights"] == told["georeference"]["heights"], again["georeference"]


@cases.case("threads make no difference")
def threads(folder):
    for threads in (1, 2):
        done = by_trees(RUN, MAP, folder / str(threads), "--near", 100, -50, "--threads", threads)
        assert done.returncode == 0, done.stderr
    for name in ("trajectory.tum", "trees.csv"):
        assert (folder / "1" / name).read_bytes() == (folder / "2" / name).read_bytes(), name


@cases.case("a map of another forest is not trusted")
def other(folder):
    done = by_trees(RUN, write_map(folder / "other.csv", from_air(forest(2))), folder / "out")
    assert done.returncode == 4, (done.returncode, done.stderr)
    assert "not found in other.csv" in done.stderr and "chance" in done.stderr, done.stderr
    run = json.loads((folder / "out" / "run.json").read_text())
    assert run["status"] == "untrusted", run["status"]


@cases.case("maps that will not do are named")
def bad(folder):
    three = write_map(folder / "three.csv", FOREST[:3])
    empty = write_map(folder / "empty.csv", [])
    degrees = folder / "degrees.csv"
    degrees.write_text("longitude,latitude\n" + "\n".join(
        f"{25 + x / 5e4:.7f},{61 + y / 1.1e5:.7f}" for x, y, _ in FOREST) + "\n")
    grid = write_map(folder / "grid.csv", from_air(FOREST), EAST, NORTH)
    few = write_run(folder / "few", FOREST, most=4)
    for name, run, tree_map, more, words in (
            ("three", RUN, three, (), "expected 10 trees"),
            ("empty", RUN, empty, (), "expected trees: there is none"),
            ("none", RUN, folder / "none.csv", (), "no such file"),
            ("far", RUN, grid, ("--tree-map-crs", "EPSG:3067", "--near", 400000, NORTH),
             "from the rough position"),
            ("grid", RUN, grid, ("--tree-map-crs", "EPSG:4326"), "is no place in it"),
            ("bare", RUN, grid, ("--near", EAST, NORTH), "Give --tree-map-crs EPSG:CODE"),
            ("words", RUN, RUN / "trajectory.tum", (), "expected a map of trees"),
            ("folder", RUN, RUN, (), "is a folder: expected one file with a map of trees"),
            ("few", few, MAP, (), "found 4")):
        done = by_trees(run, tree_map, folder / f"out_{name}", *more)
        assert done.returncode == 3, (name, done.returncode, done.stderr, done.stdout)
        assert words in done.stderr, (name, done.stderr)
    done = by_trees(RUN, degrees, folder / "out_degrees")
    assert done.returncode == 3 and "if these are degrees" in done.stderr, done.stderr
    done = program("georeference", RUN, "--method", "trees", "-o", folder / "out")
    assert done.returncode == 2 and "--tree-map" in done.stderr, done.stderr
    done = program("georeference", RUN, "--method", "gnss-path", "--near", 1, 2, "-o", folder / "out")
    assert done.returncode == 2 and "belong to auto, trees" in done.stderr, done.stderr


cases.run()
