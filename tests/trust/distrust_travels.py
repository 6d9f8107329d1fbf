"""A run that is not to be trusted stays so through every command that goes on from it. A cloud that
cannot be a stand in metres with z up is refused. Status, reasons, report and exit code say so."""

import csv
import gzip
import json
import math
import random
import re
import shutil
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program

cases = Cases()
REASON = "12 of 30 scans could not be matched"


def stand(seed, count=70, side=26.0):
    draw = random.Random(seed)
    trees = []
    while len(trees) < count:
        tree = (draw.uniform(0, side), draw.uniform(0, side))
        if all(math.dist(tree, other) > 1.8 for other in trees):
            trees.append(tree)
    return trees


def write_trees(path, trees):
    rows = ["id,x,y,z,dbh_m,dbh_sd_m,height_m,lean_deg,observations,x_sd_m,y_sd_m"]
    rows += [f"{k + 1},{x:.3f},{y:.3f},{0.1 * x:.3f},0.2{k % 10},0.01,,2,9,0.02,0.02"
             for k, (x, y) in enumerate(trees)]
    path.write_text("\n".join(rows) + "\n")


def cloud_of(trees, seed=1, side=26.0):
    """Ground that rises and trunks of 12 m with crowns: (x, y, z)."""
    draw = random.Random(seed)
    points = [(x, y, 0.1 * x + 0.3 * math.sin(0.4 * y) + draw.gauss(0, 0.01))
              for x, y in ((draw.uniform(0, side), draw.uniform(0, side)) for _ in range(30000))]
    for x, y in trees:
        ground = 0.1 * x + 0.3 * math.sin(0.4 * y)
        for _ in range(1200):
            h, a = draw.uniform(0, 12), draw.uniform(0, 2 * math.pi)
            r = 0.11 + draw.gauss(0, 0.004) if h < 6 else draw.uniform(0, 0.3 * (12.5 - h))
            points.append((x + r * math.cos(a), y + r * math.sin(a), ground + h))
    return points


def write_ply(path, points):
    head = ("ply\nformat ascii 1.0\n" f"element vertex {len(points)}\n"
            "property float x\nproperty float y\nproperty float z\nend_header\n")
    path.write_text(head + "".join(f"{x:.5g} {y:.5g} {z:.5g}\n" for x, y, z in points))
    return path


def write_run(folder, status="untrusted", reasons=(REASON,)):
    """A run folder with views of stems, a path, trees and run.json."""
    folder.mkdir(parents=True)
    trees = stand(3)
    write_trees(folder / "trees.csv", trees)
    path, stems = [], ["frame,timestamp,x,y,z,dbh_m"]
    for k in range(14):
        x, y = 4.0 + 1.2 * k, 13.0 + 3.0 * math.sin(0.3 * k)
        path.append(f"{100 + k}.000000000 {x:.6f} {y:.6f} 1.5 0 0 0 1")
        stems += [f"{k},{100 + k}.0,{u - x:.3f},{v - y:.3f},{0.1 * u - 1.5:.3f},0.2"
                  for u, v in trees if math.hypot(u - x, v - y) < 11]
    (folder / "trajectory.tum").write_text("\n".join(path) + "\n")
    with gzip.open(folder / "stems.csv.gz", "wt") as file:
        file.write("\n".join(stems) + "\n")
    if status is not None:
        (folder / "run.json").write_text(json.dumps(
            {"command": "map", "status": status, "reasons": list(reasons)}))
    return folder


def write_terrain(path):
    lines = ["ncols 40\nnrows 40\nxllcorner -20\nyllcorner -20\ncellsize 2\nNODATA_value -9999"]
    lines += [" ".join(f"{50 + 0.1 * (-19 + 2 * c):.3f}" for c in range(40)) for _ in range(40)]
    path.write_text("\n".join(lines) + "\n")
    return path


RUN = write_run(cases.folder / "forest")
OTHER = cases.folder / "other.csv"  # the same stand, seen a second time
write_trees(OTHER, [(x + 0.02, y - 0.01) for x, y in stand(3)])
DEM = write_terrain(cases.folder / "ground.asc")
CLOUD = write_ply(cases.folder / "plot.ply", cloud_of(stand(3)))
ON_TERRAIN = ("--method", "terrain", "--dem", DEM, "--start", 0, 0, 0)


def commands(run, folder):
    """The commands that go on from a run, by name."""
    return {"georeference": ("georeference", run, *ON_TERRAIN, "-o", folder / "georeference"),
            "correct": ("correct", run, "-o", folder / "correct"),
            "correct the file": ("correct", run / "stems.csv.gz", "-o", folder / "correct the file"),
            "merge": ("merge", run, OTHER, "-o", folder / "merge"),
            "merge the file": ("merge", OTHER, run / "trees.csv", "-o", folder / "merge the file"),
            "inventory": ("inventory", run, "-o", folder / "inventory")}


def check(name, done, folder, status, reason):
    assert done.returncode == (0 if status == "complete" else 4), (name, done)
    told = json.loads((folder / name / "run.json").read_text())
    assert told["status"] == status, (name, told["status"], told["reasons"])
    assert told["wall_s"] > 0, (name, told["wall_s"])
    if not reason:
        return
    assert any(reason in one for one in told["reasons"]), (name, told["reasons"])
    assert reason in done.stderr, (name, done.stderr)
    page = folder / name / "report.html"
    if not name.startswith("merge"):
        assert reason in page.read_text(), name


def made_of(run, folder):
    """Each command's outcome. Only inventory needs a map, and takes a PLY for one."""
    for name, words in commands(run, folder).items():
        if name == "inventory":
            shutil.copy(CLOUD, run / "map.laz")
        yield name, program(*words)
        (run / "map.laz").unlink(missing_ok=True)


@cases.case("status and reasons go on through each command")
def travels(folder):
    for status in ("untrusted", "partial"):
        run = write_run(folder / status, status)
        for name, done in made_of(run, folder / f"of {status}"):
            check(name, done, folder / f"of {status}", status, f"run {status}: {REASON}")


@cases.case("what is complete stays complete")
def complete(folder):
    run = write_run(folder / "run", "complete", ())
    for name, done in made_of(run, folder / "of"):
        check(name, done, folder / "of", "complete", "")


@cases.case("a chain of commands keeps it, and says where it comes from")
def chain(folder):
    last = RUN
    words = (("georeference", *ON_TERRAIN), ("correct",), ("georeference", *ON_TERRAIN))
    name = f"run forest: {REASON}"
    for k, (command, *more) in enumerate(words):
        done = program(command, last, *more, "-o", folder / f"step{k}")
        assert done.returncode == 4 and name in done.stderr, (k, done)
        last, name = folder / f"step{k}", f"run step{k}: {name}"
    good = write_run(folder / "good", "complete", ())
    for maps in ((last, good), (good, last)):
        done = program("merge", *maps, "-o", folder / "both", "--overwrite")
        assert done.returncode == 4 and name in done.stderr, done
    done = program("merge", folder / "both", good, "-o", folder / "all")
    assert done.returncode == 4 and f"run both: {name}" in done.stderr, done


@cases.case("a run.json that is missing or cannot be read")
def unreadable(folder):
    run = write_run(folder / "bare", None)
    for name, done in made_of(run, folder / "of"):
        if name.endswith("the file"):  # a file alone may be anybody's
            assert done.returncode == 0, done
            continue
        check(name, done, folder / "of", "untrusted", "run bare: it holds no run.json")
    (run / "run.json").write_text('{"status": "compl')
    for name, done in made_of(run, folder / "broken"):
        check(name, done, folder / "broken", "untrusted", "run bare: its run.json cannot be read")


def inventory(cloud, folder, *options):
    return program("inventory", cloud, "-o", folder / "inventory", "--overwrite", *options)


def tilted(point, lean_deg, around_deg):
    """As a scanner sees it whose axis leans by that, about a level axis in that direction."""
    x, y, z = point
    a, b = math.radians(around_deg), math.radians(lean_deg)
    along, across = x * math.cos(a) + y * math.sin(a), y * math.cos(a) - x * math.sin(a)
    across, z = across * math.cos(b) - z * math.sin(b), across * math.sin(b) + z * math.cos(b)
    return along * math.cos(a) - across * math.sin(a), along * math.sin(a) + across * math.cos(a), z


def listed(folder):
    return len(list(csv.DictReader((folder / "inventory" / "trees.csv").open())))


@cases.case("a cloud in feet without a coordinate system")
def feet(folder):
    tall = [(x, y, z * (1 + 0.5 * (z > 2))) for x, y, z in cloud_of(stand(3))]
    cloud = write_ply(folder / "feet.ply", [(x / 0.3048, y / 0.3048, z / 0.3048) for x, y, z in tall])
    done = inventory(cloud, folder)
    assert done.returncode == 4 and "usual for feet" in done.stderr and "--unit-m 0.3048" in done.stderr, done
    told = json.loads((folder / "inventory" / "run.json").read_text())
    assert told["status"] == "untrusted", told["reasons"]
    for unit in (0.3048, 1):
        done = inventory(cloud, folder, "--unit-m", unit)
        assert "usual for feet" not in done.stderr and done.returncode in (0, 4), done


@cases.case("a cloud in millimetres, or with another axis up")
def clouds(folder):
    points = cloud_of(stand(3))
    done = inventory(CLOUD, folder)
    upright = listed(folder)
    assert done.returncode == 0 and upright > 55, (done, upright)
    small = write_ply(folder / "mm.ply", [(1000 * x, 1000 * y, 1000 * z) for x, y, z in points])
    done = inventory(small, folder)
    assert done.returncode == 3 and "millimetres" in done.stderr and "--unit-m" in done.stderr, done
    done = inventory(small, folder, "--unit-m", 0.001)
    assert done.returncode == 0 and abs(listed(folder) - upright) <= 2, (done, listed(folder))
    for axis, turned in (("x", lambda x, y, z: (z, x, y)), ("y", lambda x, y, z: (x, z, -y)),
                         ("-z", lambda x, y, z: (x, -y, -z))):
        cloud = write_ply(folder / "turned.ply", [turned(*p) for p in points])
        done = inventory(cloud, folder)
        assert done.returncode == 3 and f"--up {axis}" in done.stderr, (axis, done)
        done = inventory(cloud, folder, "--up", axis)
        assert done.returncode == 0 and abs(listed(folder) - upright) <= 2, (axis, listed(folder))
    for lean, around in ((20, 30), (40, 200), (60, 300)):
        cloud = write_ply(folder / "tilted.ply", [tilted(p, lean, around) for p in points])
        done = inventory(cloud, folder)
        up = re.search(r"--up=[-0-9.]+,[-0-9.]+,[-0-9.]+", done.stderr)
        assert done.returncode == 3 and up and "stems lean" in done.stderr, (lean, done)
        done = inventory(cloud, folder, up[0])
        assert done.returncode == 0 and abs(listed(folder) - upright) <= 6, (lean, listed(folder), upright)
    for wrong in ("up", "1,2", "0,0,0", "1,2,nan", "1,2,3,4"):
        assert inventory(cloud, folder, f"--up={wrong}").returncode == 2, wrong
    cloud = write_ply(folder / "turned.ply", [(x, -y, -z) for x, y, z in points])
    # A frame that is given is taken as it is.
    assert inventory(cloud, folder, "--up", "z").returncode in (0, 4)
    # The map of a run is not refused, but not trusted either.
    run = write_run(folder / "run", "complete", ())
    shutil.copy(cloud, run / "map.laz")
    done = inventory(run, folder)
    assert done.returncode == 4 and "z is not up" in done.stderr, done


cases.run()
