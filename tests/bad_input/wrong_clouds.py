"""Clouds and tree lists in a wrong frame or unit, through `understory inventory`, `merge` and `evaluate
trees`. A list that is wrong is never called complete."""

import csv
import json
import math
import random
import re

import laspy
import numpy as np

from program import Cases, placed_recording, program

cases = Cases()
SIDE = 20.0
WALK = placed_recording(6, 12)


def places(seed, count=24):
    draw = random.Random(seed)
    trees = []
    while len(trees) < count:
        tree = (draw.uniform(1, SIDE - 1), draw.uniform(1, SIDE - 1))
        if all(math.dist(tree, other) > 2.2 for other in trees):
            trees.append(tree)
    return trees


def tree_points(x, y, height, draw, returns=2500):
    """A trunk and, above its half, a crown."""
    for _ in range(returns):
        h, a = draw.uniform(0, height), draw.uniform(0, 2 * math.pi)
        r = 0.11 + draw.gauss(0, 0.004) if h < height / 2 else draw.uniform(0, 0.3 * (height + 0.5 - h))
        yield x + r * math.cos(a), y + r * math.sin(a), h


def plot(height=14.0, seed=3):
    """Even ground and trees of that height."""
    draw = random.Random(seed)
    points = [(draw.uniform(0, SIDE), draw.uniform(0, SIDE), draw.gauss(0, 0.01)) for _ in range(20000)]
    for x, y in places(seed):
        points += tree_points(x, y, height, draw)
    return points


def write_ply(path, points):
    head = ("ply\nformat ascii 1.0\n" f"element vertex {len(points)}\n"
            "property float x\nproperty float y\nproperty float z\nend_header\n")
    path.write_text(head + "".join(f"{x:.6g} {y:.6g} {z:.6g}\n" for x, y, z in points))
    return path


def inventory(cloud, folder, *options):
    return program("inventory", cloud, "-o", folder / "inventory", "--overwrite", *options)


def listed(folder):
    return list(csv.DictReader((folder / "inventory" / "trees.csv").open()))


@cases.case("a plot as it is")
def good_plot(folder):
    cloud = write_ply(folder / "plot.ply", plot())
    for options in ((), ("--crs", "EPSG:3067"), ("--crs", "EPSG:3067+3900")):
        done = inventory(cloud, folder, *options)
        assert done.returncode == 0 and len(listed(folder)) > 20, (options, done)
    # A meadow has no stem, and its list is complete.
    meadow = write_ply(folder / "meadow.ply", [p for p in plot() if p[2] < 0.2])
    assert inventory(meadow, folder).returncode in (0, 4)
    return f"{len(listed(folder))} trees in the meadow"


@cases.case("a LAS file whose places are rounded to a decimetre is told, one of centimetres is not")
def rounded_places(folder):
    for scale, told in ((0.01, False), (0.1, True)):
        cloud = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
        cloud.header.scales = [scale] * 3
        cloud.x, cloud.y, cloud.z = np.array(plot()).T
        cloud.write(folder / "rounded.las")
        done = inventory(folder / "rounded.las", folder)
        assert done.returncode == (4 if told else 0), done
        assert ("inventory.coarse_places" in done.stderr) == told, (scale, done.stderr)
        run = json.loads((folder / "inventory" / "run.json").read_text())
        assert run["status"] == ("untrusted" if told else "complete"), run
        assert any("steps of 0.1 m" in reason for reason in run["reasons"]) == told, run
        words = {tree["quality"] for tree in listed(folder)}
        assert told or "good" in words, words
        assert not told or words <= {"coarse", "weak_diameter", "no_diameter"} and "coarse" in words, words
        assert ("steps of 0.1 m" in done.stderr) == told, (scale, done.stderr)
    return done.stderr


@cases.case("a cloud whose points are all of the class noise is told so, in memory and in tiles")
def all_noise(folder):
    cloud = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    cloud.header.scales = [0.001] * 3
    cloud.x, cloud.y, cloud.z = np.array(plot()).T
    cloud.classification = np.full(len(cloud.x), 7, dtype=np.uint8)
    cloud.write(folder / "noise.las")
    for options in ((), ("--set", "tiles.size_m=30")):
        done = inventory(folder / "noise.las", folder, *options)
        assert done.returncode == 3 and "all points are classed as noise" in done.stderr, done


# The matrix alone says kilometres where the cloud moved by decimetres.
@cases.case("two clouds in map coordinates, one of them tilted")
def map_coordinates(folder):
    points, clouds = plot(), []
    tilt = math.radians(1.0)
    for name, tilted in (("a.xyz.ply", False), ("b.xyz.ply", True)):
        head = (f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty double x\nproperty double y\n"
                "property double z\nend_header\n")
        rows = []
        for x, y, z in points:
            dx = x - SIDE / 2
            if tilted:  # about the plot's middle, and moved by 0.3 m to the west
                dx, z = dx * math.cos(tilt) + z * math.sin(tilt) - 0.3, z * math.cos(tilt) - dx * math.sin(tilt)
            rows.append(f"{470000 + dx:.4f} {3810000 + y:.4f} {2300 + z:.4f}")
        (folder / name).write_text(head + "\n".join(rows) + "\n")
        clouds.append(folder / name)
    done = program("register", *clouds, "--json")
    assert done.returncode == 0, done
    found = json.loads(done.stdout)
    assert abs(found["turn_deg"] - 1.0) < 0.1, found
    assert math.dist(found["middle_of_b"][:2], (470000, 3810010)) < 1.0, found
    matrix, place = found["a_from_b"], [*found["middle_of_b"], 1.0]
    moved = [sum(matrix[4 * r + c] * place[c] for c in range(4)) - place[r] for r in range(3)]
    assert math.dist(moved, found["shift_there_m"]) < 1e-6, (moved, found)
    assert math.hypot(*found["shift_there_m"]) < 1.0 < 1000.0 < math.hypot(matrix[3], matrix[7], matrix[11]), found
    text = program("register", *clouds).stdout
    assert f"turn_deg {found['turn_deg']:.3f}" in text and "shift_there_m " in text, text
    return f"{found['shift_there_m']} at the plot, {matrix[11]:.0f} m in the matrix"


# A tree of its own had 2,462 stems per hectare "on 0.000 ha", with no word of doubt.
@cases.case("a single tree")
def single_tree(folder):
    x, y = SIDE / 2, SIDE / 2
    points = [p for p in plot() if p[2] < 0.1 and math.dist(p[:2], (x, y)) < 1.5]
    points += tree_points(x, y, 14.0, random.Random(1), 9000)
    done = inventory(write_ply(folder / "tree.ply", points), folder)
    assert done.returncode == 0 and done.stdout.startswith("1 tree; 1 of them on "), done
    told = [warning["message"] for warning in json.loads((folder / "inventory" / "run.json").read_text())["warnings"]]
    assert " m2 seen" in done.stdout and any("say little of a stand" in each for each in told), (done, told)
    return done.stdout.strip()


# Its list of no tree was complete: what the user says of the frame is not checked, but what comes of it is.
@cases.case("a plot that the user turns upside down")
def upside_down(folder):
    cloud = write_ply(folder / "plot.ply", plot())
    done = inventory(cloud, folder, "--up=-z")
    # A crown that stands on its top may hold a thin column.
    assert done.returncode == 4 and all(float(tree["dbh_m"]) < 0.05 for tree in listed(folder)), done
    assert "no stem was found" in done.stderr and "though points stand" in done.stderr, done
    return done.stderr.strip()


# With a system in metres nothing was said: trees of 46 m are told from heights in feet by their diameters.
@cases.case("heights in feet and a system in metres")
def heights_in_feet(folder):
    cloud = write_ply(folder / "plot.ply", [(x, y, z / 0.3048) for x, y, z in plot(16.0)])
    done = inventory(cloud, folder, "--crs", "EPSG:3067")
    assert done.returncode == 4 and "times as high as thick" in done.stderr, done
    said = done.stderr.strip()
    done = inventory(cloud, folder, "--unit-m", 1)
    assert "times as high as thick" not in done.stderr, done
    return said


@cases.case("a system in feet or degrees that the user names")
def named_system(folder):
    cloud = write_ply(folder / "plot.ply", plot())
    for crs, words in (("EPSG:2276", "counts in units of 0.3048006 m"), ("EPSG:4326", "is in degrees"),
                       ("EPSG:3067+6360", "in the plane and of 0.3048006 m in height")):
        done = inventory(cloud, folder, "--crs", crs)
        assert done.returncode == 3 and words in done.stderr, (crs, done)
    # The layers of scaled coordinates were said to be in feet.
    done = inventory(cloud, folder, "--crs", "EPSG:2276", "--unit-m", 0.3048)
    assert done.returncode == 2 and "--crs does not hold" in done.stderr, done
    return done.stderr.strip()


# `evaluate map` said that its surfaces were 0.2 mm thick, and `register` that a cloud matched itself 0.8 m away.
@cases.case("a map in degrees or feet")
def map_in_degrees(folder):
    figures = {}
    for name, options in (("metres", ()), ("degrees", ("--crs", "EPSG:4979")), ("feet", ("--crs", "EPSG:6885"))):
        run = folder / name
        done = program("map", WALK, "-o", run, *options)
        assert done.returncode == 0, (name, done)
        done = program("evaluate", "map", run, "--json")
        assert done.returncode == 0, (name, done)
        figures[name] = json.loads(done.stdout)["mean_entropy_nats"]
        cloud = run / "map.laz"
        for words in (("evaluate", "map", cloud), ("register", cloud, cloud), ("inventory", cloud, "-o", folder / "x")):
            done = program(*words, *(("--overwrite",) if words[0] == "inventory" else ()))
            if name == "metres":
                assert done.returncode in (0, 4), (name, words, done)
            else:
                wanted = "is in degrees" if name == "degrees" else "counts in units of 0.3048 m"
                assert done.returncode == 3 and wanted in done.stderr, (name, words, done)
    assert max(figures.values()) - min(figures.values()) < 0.02, figures
    return str(figures)


def write_list(path, trees, unit=1.0):
    rows = ["id,x,y,z,dbh_m,height_m,observations"]
    rows += [f"{k + 1},{x:.3f},{y:.3f},0,{d * unit:.6g},{h:.1f},{n}" for k, (x, y, d, h, n) in enumerate(trees)]
    path.write_text("\n".join(rows) + "\n")
    return path


def two_lists(seed=7):
    """One stand as two surveys saw it."""
    draw = random.Random(seed)
    first = [(x, y, draw.uniform(0.12, 0.4), 15.0, draw.randrange(20, 90)) for x, y in places(seed, 40)]
    second = [(x + draw.gauss(0, 0.03), y + draw.gauss(0, 0.03), d * draw.gauss(1, 0.03), h, draw.randrange(20, 90))
              for x, y, d, h, _ in first]
    return first, second


def merged(folder, a, b):
    return program("merge", a, b, "-o", folder / "merged", "--overwrite")


@cases.case("lists in two frames")
def two_frames(folder):
    first, second = two_lists()
    a = write_list(folder / "a.csv", first)
    b = write_list(folder / "b.csv", [(x + 7.3, y - 4.1, *rest) for x, y, *rest in second])
    done = program("evaluate", "trees", a, b)
    assert done.returncode == 4 and "of 40 trees match: A and B may lie in different frames. --align yaw" in done.stderr, done
    assert "[evaluate.trees]" in done.stderr, done
    done = program("evaluate", "trees", a, b, "--json")  # the figures are told all the same
    assert done.returncode == 4 and json.loads(done.stdout)["trees_a"] == 40, done
    for words in ((a, b, "--align", "yaw"), (a, a)):
        done = program("evaluate", "trees", *words)
        assert done.returncode == 0 and "trees match" not in done.stderr, done
        assert "bias 0.0000 m in x" in done.stdout and not re.search(r"[-+]0\.0+\b", done.stdout), done.stdout
    other = write_list(folder / "c.csv", two_lists(99)[0])
    done = program("evaluate", "trees", a, other, "--align", "yaw")
    assert done.returncode == 4 and "may show different stands" in done.stderr, done
    few = write_list(folder / "d.csv", [(x + 500, y, *rest) for x, y, *rest in first[:3]])
    done = program("evaluate", "trees", few, a)
    assert done.returncode == 4 and "only 0 of 3 trees match" in done.stderr, done
    few.write_text("id,x,y\n")
    done = program("evaluate", "trees", few, a)
    assert done.returncode == 0, done  # an empty list has no frame
    return done.stdout.splitlines()[1]


@cases.case("diameters in another unit")
def units(folder):
    first, second = two_lists()
    a = write_list(folder / "a.csv", first)
    done = merged(folder, a, write_list(folder / "b.csv", second))
    assert done.returncode == 0, done
    for name, unit, words in (("centimetres", 100, "they look like centimetres"), ("inches", 1 / 0.0254, "or inches"),
                              ("millimetres", 1000, "they look like millimetres"), ("kilometres", 0.001, "no metres"),
                              ("feet", 1 / 0.3048, "times those of the first"), ("radii", 0.5, "or holds radii")):
        b = write_list(folder / f"{name}.csv", second, unit)
        for one, other in ((a, b), (b, a)):
            done = merged(folder, one, other)
            assert done.returncode == 4 and (words in done.stderr or "times those of the first" in done.stderr), (
                name, done)
        assert words in merged(folder, a, b).stderr, name
        said = program("evaluate", "trees", b, a).stderr
        assert ("no metres" in said) == (name not in ("feet", "radii")), (name, said)
    return done.stderr.strip().replace(str(folder), "").splitlines()[0]


@cases.case("trees that stand twice in a list")
def doubled(folder):
    first, second = two_lists()
    draw = random.Random(2)
    twice = second + [(x + draw.uniform(-0.02, 0.02), y + draw.uniform(-0.02, 0.02), d, h, n)
                      for x, y, d, h, n in second[:12]]
    a, b = write_list(folder / "a.csv", first), write_list(folder / "b.csv", twice)
    for one, other in ((a, b), (b, a)):
        done = merged(folder, one, other)
        assert done.returncode == 4 and f"{b}: 12 of 52 rows lie within 5 cm" in done.stderr, done
    assert "stand twice" in program("evaluate", "trees", b, a).stderr
    # A copy with doubled rows, or in another order, was taken for a second survey.
    for name, rows in (("doubled", first + twice[-12:]), ("reversed", first[::-1]), ("part", first[:25])):
        done = merged(folder, a, write_list(folder / f"{name}.csv", rows))
        assert done.returncode == 4 and "both maps hold the same trees" in done.stderr, (name, done)
    return done.stderr.strip().replace(str(folder), "")


cases.run()
