"""`output.world_frame=ned` of `map`: the same recording in both axes. Turned by the matrix of the pages,
each file is that of the run in east, north, up. Clouds and layers have the same bytes, and every command
that reads a run says the same of both. By stems, too."""

import csv
import gzip
import json
import math
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, placed_recording, program

cases = Cases()
PATHS = ("trajectory.tum", "trajectory_imu.tum", "trajectory_partial.tum", "keyframes.tum", "odometry.tum")
TABLES = {"states.csv.gz": (("vx", "vy", "vz"),), "gnss.csv": (("x", "y", "z"), ("residual_x", "residual_y", "residual_z")),
          "trees.csv": (("x", "y", "z"), ("x_sd_m", "y_sd_m")), "stem_curves.csv": (("x", "y"),), "dead_wood.csv": (("x", "y", "z"), ("x_to", "y_to", "z_to")), "felled.csv": (("x", "y"),),
          "cuts.csv": (("x", "y", "z"),), "plots.csv": (("x", "y"),)}
LAYERS = ("map.laz", "dtm.tif", "chm.tif", "dsm.tif", "trees.gpkg", "map.qgs", "global.csv.gz", "stems.csv.gz", "steps.csv")
DENSE = ("trajectory.tum", "trajectory_imu.tum", "trajectory_partial.tum", "keyframes.tum", "states.csv.gz", "gnss.csv",
         "trees.csv", "stem_curves.csv", "dead_wood.csv", "plots.csv", "graph.g2o")
BY_STEMS = ("trajectory.tum", "odometry.tum", "trees.csv", "felled.csv", "gnss.csv")


def text(path):
    return (gzip.open(path, "rt") if path.suffix == ".gz" else path.open()).read()


def rotation(x, y, z, w):
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]


def turned(x, y, z):
    """North, east, down of east, north, up."""
    return [y, x, -z]


def same_pose(enu, ned, name):
    assert ned[:3] == turned(*enu[:3]), f"{name}: {enu} {ned}"
    assert ned[6] >= 0, f"{name}: {ned}"
    rows = rotation(*enu[3:])
    expected = [rows[1], rows[0], [-v for v in rows[2]]]
    found = rotation(*ned[3:])
    worst = max(abs(a - b) for one, other in zip(expected, found) for a, b in zip(one, other))
    assert worst < 5e-9, f"{name}: attitudes differ by {worst}"


def same_paths(enu, ned):
    pairs = list(zip(text(enu).splitlines(), text(ned).splitlines(), strict=True))
    assert pairs, enu
    for one, other in pairs:
        (stamp, *a), (other_stamp, *b) = one.split(), other.split()
        assert stamp == other_stamp
        same_pose([float(v) for v in a], [float(v) for v in b], enu.name)


def same_graphs(enu, ned):
    kinds = set()
    for one, other in zip(text(enu).splitlines(), text(ned).splitlines(), strict=True):
        kind, *a = one.split()
        kinds.add(kind)
        if kind != "VERTEX_SE3:QUAT":
            assert one == other
            continue
        same_pose([float(v) for v in a[1:]], [float(v) for v in other.split()[2:]], enu.name)
    assert "VERTEX_SE3:QUAT" in kinds and "EDGE_SE3:QUAT" in kinds


def same_tables(enu, ned, turning):
    rows = list(zip(csv.DictReader(text(enu).splitlines()), csv.DictReader(text(ned).splitlines()), strict=True))
    moved = False
    for one, other in rows:
        for columns in turning:
            a, b = ([row[c] for c in columns] for row in (one, other))
            assert b[:2] == a[1::-1], f"{enu.name}: {columns}: {a} {b}"
            if len(columns) == 3 and a[2]:
                assert float(b[2]) == -float(a[2]), f"{enu.name}: {a} {b}"
            moved = moved or a[:2] != b[:2]
        of_world = {c for columns in turning for c in columns}
        assert {c: v for c, v in one.items() if c not in of_world} == {c: v for c, v in other.items() if c not in of_world}
    assert moved or not rows, f"{enu.name} is not turned"


def same_run(enu, ned, expected):
    """Every file of the two folders; those of `expected` must be there."""
    for name in expected:
        assert (enu / name).exists() and (ned / name).exists(), f"no {name}"
    assert sorted(p.name for p in enu.iterdir()) == sorted(p.name for p in ned.iterdir())
    frames = json.loads((ned / "run.json").read_text())["frames"]
    for path in sorted(enu.iterdir()):
        name, other = path.name, ned / path.name
        if name in PATHS:
            same_paths(path, other)
        elif name in TABLES:
            same_tables(path, other, TABLES[name])
        elif name == "graph.g2o":
            same_graphs(path, other)
        elif name == "map.qgs":  # names the run that it was made from
            assert path.read_text().replace("ned", "enu") == other.read_text().replace("ned", "enu"), name
        elif name not in ("run.json", "report.html") and path.is_file():
            assert path.read_bytes() == other.read_bytes(), f"{name} differs"
            assert frames.get(name) != "world_ned", name
            continue
        if name in PATHS or name in TABLES or name == "graph.g2o":
            assert frames[name] == "world_ned", f"{name}: {frames}"
    facts = [json.loads((folder / "run.json").read_text()) for folder in (enu, ned)]
    for key in ("status", "reasons", "warnings", "counts", "georeference", "coordinate_system", "evidence", "scans", "poses"):
        assert facts[0].get(key) == facts[1].get(key), f"{key}: {facts[0].get(key)} {facts[1].get(key)}"


def mapped(name, recording, *options):
    folders = []
    for frame in ("enu", "ned"):
        folders.append(cases.folder / f"{name}_{frame}")
        done = program("map", recording, "-o", folders[-1], "--set", f"output.world_frame={frame}", *options)
        assert done.returncode in (0, 4), done.stderr
    return folders


def both(*arguments, codes=(0,), **runs):
    """What the command says of either run: `RUN` stands for it in its arguments."""
    said = []
    for run in DENSE_RUNS if "of" not in runs else runs["of"]:
        done = program(*[run if a == "RUN" else a for a in arguments])
        assert done.returncode in codes, f"{arguments}: {done.returncode} {done.stderr}"
        said.append(done.stdout.replace(str(run), "RUN"))
    return said


RECORDING = placed_recording(6, 12)
TRUTH = RECORDING.with_suffix(".truth")
DENSE_RUNS = mapped("dense", RECORDING, "--imu-rate", "--set", "scan_fraction=0.5", "--inventory", "full", "--plot-grid", 10)
STEM_RUNS = mapped("stems", RECORDING, "--front-end", "sparse", "--set", "harvester.fells=true")


@cases.case("every file turns, or keeps its bytes")
def files(_):
    same_run(*DENSE_RUNS, (*DENSE, "map.laz", "dtm.tif", "trees.gpkg"))
    same_run(*STEM_RUNS, BY_STEMS)


@cases.case("the report lists trees as trees.csv has them")
def report(_):
    page = (DENSE_RUNS[1] / "report.html").read_text()
    assert "as in trees.csv: north, east and down." in page
    tree = next(csv.DictReader(text(DENSE_RUNS[1] / "trees.csv").splitlines()))
    numbers = [float(cell.replace("−", "-")) for cell in re.findall(r'<td class="n">([-−]?[0-9.]+)</td>', page)]
    place = [float(tree[axis]) for axis in "xyz"]
    # Both are rounded from the same number, the report to a centimetre.
    assert any(math.dist(numbers[k:k + 3], place) < 0.01 for k in range(len(numbers) - 2)), place
    assert "north, east and down" not in (DENSE_RUNS[0] / "report.html").read_text()


@cases.case("evaluate says the same of both")
def evaluated(_):
    for arguments in (("evaluate", "RUN", TRUTH, "--align", "se3", "--json"), ("evaluate", "RUN", TRUTH, "--align", "first", "--json"),
                      ("evaluate", "trees", "RUN", TRUTH, "--align", "se3", "--json")):
        one, other = both(*arguments, codes=(0, 4))
        assert one == other and "null" != one, f"{arguments}: {one} {other}"
    assert "velocity" in both("evaluate", "RUN", TRUTH, "--align", "first", "--json")[1]
    one, other = DENSE_RUNS
    done = program("evaluate", other, one, "--json")
    assert json.loads(done.stdout)["ape_rmse_m"] == 0, "a run in either axes is the same path"


@cases.case("inventory of a run is the same, to the byte")
def inventoried(folder):
    for run, result in zip(DENSE_RUNS, (folder / "enu", folder / "ned")):
        done = program("inventory", run, "-o", result)
        assert done.returncode in (0, 4), done.stderr
    for name in ("trees.csv", "stem_curves.csv", "dtm.tif", "trees.gpkg"):
        assert (folder / "enu" / name).read_bytes() == (folder / "ned" / name).read_bytes(), name


@cases.case("georeference lays both at one place, and keeps their axes, also twice and by points")
def georeferenced(folder):
    placed = [folder / "enu", folder / "ned"]
    for run, result in zip(DENSE_RUNS, placed):
        done = program("georeference", run, "--method", "split", "-o", result)
        assert done.returncode in (0, 4), done.stderr
    same_run(*placed, ("trajectory.tum", "trees.csv", "gnss.csv", "trajectory_imu.tum", "map.laz"))
    moved = [folder / "twice_enu", folder / "twice_ned"]
    for index, (run, result) in enumerate(zip(placed, moved)):
        points = folder / f"points{index}.csv"
        trees = list(csv.DictReader(text(run / "trees.csv").splitlines()))[:4]
        rows = [f"{t['id']},{500000 + float(t['y' if index else 'x']):.3f},{6800000 + float(t['x' if index else 'y']):.3f},"
                f"{100 + float(t['z']) * (-1 if index else 1):.3f},{t['x']},{t['y']},{t['z']}" for t in trees]
        points.write_text("name,east_m,north_m,height_m,x,y,z\n" + "\n".join(rows) + "\n")
        done = program("georeference", run, "--method", "points", "--points", points, "--crs", "EPSG:3067", "-o", result)
        assert done.returncode in (0, 4), done.stderr
    same_run(*moved, ("trajectory.tum", "trees.csv", "map.laz"))


@cases.case("correct, merge and epochs go on from either")
def gone_on(folder):
    corrected = [folder / "enu", folder / "ned"]
    for run, result in zip(STEM_RUNS, corrected):
        done = program("correct", run, "-o", result)
        assert done.returncode in (0, 4), done.stderr
    same_run(*corrected, ("trajectory.tum", "trees.csv"))
    merged = [folder / "merged_enu", folder / "merged_ned"]
    for run, result in zip(STEM_RUNS, merged):
        done = program("merge", run, DENSE_RUNS[0], "-o", result)
        assert done.returncode in (0, 4), done.stderr
    assert (merged[0] / "trees.csv").read_bytes() == (merged[1] / "trees.csv").read_bytes()
    one, other = both("evaluate", "trees", "RUN", DENSE_RUNS[0], "--epochs", "--json", codes=(0, 4), of=STEM_RUNS)
    assert one == other, f"{one} {other}"


@cases.case("wrong values end with code 2, and the message names those there are")
def wrong(folder):
    for value in ("NED", "north", "", "1"):
        done = program("map", RECORDING, "-o", folder / "run", "--set", f"output.world_frame={value}")
        assert done.returncode == 2 and "enu|ned" in done.stderr and "output.world_frame" in done.stderr, done.stderr
        assert not (folder / "run").exists()
    done = program("map", RECORDING, "-o", folder / "run", "--set", "output.worldframe=ned")
    assert done.returncode == 2 and "output.world_frame" in done.stderr, done.stderr


@cases.case("a run that may be turned, with a damaged run.json, is refused")
def damaged(folder):
    run = folder / "run"
    run.mkdir()
    (run / "trajectory.tum").write_bytes((DENSE_RUNS[1] / "trajectory.tum").read_bytes())
    content = (DENSE_RUNS[1] / "run.json").read_text()
    for cut in (content[: content.index("world_ned") + 20], content[: content.index("effective_config")]):
        (run / "run.json").write_text(cut)
        done = program("evaluate", run, TRUTH, "--align", "se3")
        assert done.returncode == 3 and "north, east, down" in done.stderr, done.stderr


cases.run()
