"""`understory merge` and the agreement of two tree maps: lists bent against each other, in other
frames, and what is no tree list."""

import csv
import json
import math
import random
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program

cases = Cases()
HEADER = "id,x,y,z,dbh_m,dbh_sd_m,height_m,lean_deg,observations,x_sd_m,y_sd_m\n"


def stand(count=300, side=80.0):
    draw = random.Random(7)
    trees = []
    while len(trees) < count:
        tree = (draw.uniform(0, side), draw.uniform(0, side))
        if all(math.dist(tree, other) > 2.2 for other in trees):
            trees.append(tree)
    return trees


def bent(trees):
    return [(x + 0.5 * math.sin(0.05 * y) + 0.2, y + 0.4 * math.cos(0.04 * x)) for x, y in trees]


def turned(trees, angle=0.7, shift=(30.0, -12.0)):
    c, s = math.cos(angle), math.sin(angle)
    return [(c * x - s * y + shift[0], s * x + c * y + shift[1]) for x, y in trees]


def write(path, trees):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = "".join(f"{k + 1},{x:.4f},{y:.4f},0,0.25,0.01,,,9,,\n" for k, (x, y) in enumerate(trees))
    path.write_text(HEADER + rows)
    return path


def places(path):
    with path.open() as file:
        return [(float(row["x"]), float(row["y"])) for row in csv.DictReader(file)]


@cases.case("two maps bent against each other become one")
def merged(folder):
    trees = stand()
    a = write(folder / "a" / "trees.csv", trees[:260])
    b = write(folder / "b" / "trees.csv", turned(bent(trees)[40:]))
    done = program("merge", a.parent, b, "--align", "--weight", 0, "-o", folder / "both", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["trees_a"] == 260 and told["trees_b"] == 260, told
    assert 210 <= told["joined"] <= 220, told
    assert told["trees"] == 520 - told["joined"], told
    assert told["apart_m"] < 0.15, told
    both = places(folder / "both" / "trees.csv")
    near = [min(math.dist(tree, other) for other in both) for tree in trees[:260]]
    assert max(near) < 0.6 and sum(near) / len(near) < 0.06, max(near)
    field = (folder / "both" / "deformation.csv").read_text().splitlines()
    assert len(field) == 261 and field[0].startswith("x,y,dx,dy"), field[0]
    again = program("merge", a.parent, b, "--align", "--weight", 0, "-o", folder / "again",
                    "--threads", 1)
    assert again.returncode == 0, again.stderr
    for name in ("trees.csv", "deformation.csv"):
        assert (folder / "both" / name).read_bytes() == (folder / "again" / name).read_bytes()


def drawn(report, colour):
    """Points of the line of that colour in the picture of arrows."""
    section = report.split("How far the two maps are apart")[1].split("</section>")[0]
    way = re.search(rf'd="([^"]*)" fill="none" stroke="var\(--{colour}\)"', section)
    return way and [tuple(map(float, point.split())) for point in re.split("[ML]", way[1])[1:]]


@cases.case("the report draws how one map is bent onto the other, and the paths with it")
def pictured(folder):
    trees = stand()
    a = write(folder / "a" / "trees.csv", trees).parent
    b = write(folder / "b" / "trees.csv", turned(bent(trees))).parent
    way = [(2.0 * k, 40.0) for k in range(40)]
    for map_folder, path in ((a, way), (b, turned(bent(way)))):
        (map_folder / "trajectory.tum").write_text(
            "".join(f"{k}.0 {x} {y} 0 0 0 0 1\n" for k, (x, y) in enumerate(path)))
    done = program("merge", a, b, "--align", "-o", folder / "both")
    # No run.json beside the trees: 4, since nothing tells whether the maps can be trusted.
    assert done.returncode == 4, done.stderr
    report = (folder / "both" / "report.html").read_text()
    first, second, moved = (drawn(report, colour) for colour in ("text", "bad", "good"))
    assert first and len(first) == len(second) == len(moved) == 40, report[:200]
    before = max(math.dist(p, q) for p, q in zip(first, second))
    after = max(math.dist(p, q) for p, q in zip(first[3:-3], moved[3:-3]))
    assert after < 0.4 * before, (before, after)
    arrows = report.split('class="field" d="')[1].split('"')[0]
    assert arrows.count("M") == 2 * len(trees), arrows.count("M")
    done = program("merge", write(folder / "a.csv", trees), b, "--align", "-o", folder / "alone")
    assert done.returncode == 4, done.stderr
    report = (folder / "alone" / "report.html").read_text()
    assert drawn(report, "text") is None and "Path of the first map" not in report
    (b / "trajectory.tum").write_text("1.0 2 3\n")
    done = program("merge", a, b, "--align", "-o", folder / "cut")
    assert done.returncode == 3 and "trajectory.tum" in done.stderr, done
    assert not (folder / "cut" / "trees.csv").exists()


@cases.case("the best weight is that of the map which a reference agrees with")
def reference(folder):
    trees = stand()
    a = write(folder / "a.csv", bent(trees))
    b = write(folder / "b.csv", trees)
    truth = write(folder / "truth.csv", trees)
    done = program("merge", a, b, "-o", folder / "both", "--reference", truth, "--json")
    assert done.returncode == 0, done.stderr
    best = json.loads(done.stdout)["best"]
    assert 0.85 <= best["weight"] <= 1.15 and best["position_rmse_m"] < 0.1, best


@cases.case("felled trees keep their places and times")
def felled(folder):
    trees = stand(120)
    a = write(folder / "a" / "trees.csv", trees[:100]).parent
    b = write(folder / "b" / "trees.csv", [(x + 0.2, y) for x, y in trees[20:]]).parent
    head = "id,x,y,seen_until,gone_since,missed\n"
    # By number: 30 and 90 of A; of B the same tree as 30 of A (11), and one that A does not list (95).
    (a / "felled.csv").write_text(head + "30,0,0,1500000010.000000001,1500000030.000000000,9\n"
                                  "90,0,0,1500000100.000000000,1500000130.000000000,8\n")
    (b / "felled.csv").write_text(head + "10,0,0,1500000020.000000002,1500000050.000000000,7\n"
                                  "95,0,0,1500000200.000000000,1500000220.000000000,12\n")
    done = program("merge", a, b, "--weight", 0, "-o", folder / "both", "--json")
    assert done.returncode == 0 and json.loads(done.stdout)["felled"] == 3, done
    rows = {row["id"]: row for row in csv.DictReader((folder / "both" / "felled.csv").open())}
    listed = {row["id"]: row for row in csv.DictReader((folder / "both" / "trees.csv").open())}
    assert set(rows) == {"30", "90", "115"}, rows
    assert all((rows[k]["x"], rows[k]["y"]) == (listed[k]["x"], listed[k]["y"]) for k in rows), rows
    assert rows["30"]["seen_until"] == "1500000020.000000002", rows["30"]
    assert rows["30"]["gone_since"] == "1500000030.000000000" and rows["30"]["missed"] == "16", rows
    assert math.dist((float(rows["115"]["x"]), float(rows["115"]["y"])), trees[114]) < 0.3, rows
    (b / "felled.csv").write_text(head + "10,0,0,noon,1500000050,7\n")
    done = program("merge", a, b, "-o", folder / "bad")
    assert done.returncode == 3 and "felled.csv" in done.stderr and "line 2" in done.stderr, done


def planted(seed, count=110, side=34.0):
    """Another stand for each seed, with diameters."""
    draw = random.Random(seed)
    trees = []
    while len(trees) < count:
        tree = (draw.uniform(0, side), draw.uniform(0, side))
        if all(math.dist(tree, other[:2]) > 1.3 for other in trees):
            trees.append((*tree, draw.gauss(0.22, 0.05)))
    return trees


def write_measured(path, trees, with_diameters=True):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = "".join(f"{k + 1},{x:.4f},{y:.4f},0,{f'{d:.3f}' if with_diameters else ''},0.01,,,9,,\n"
                   for k, (x, y, d) in enumerate(trees))
    path.write_text(HEADER + rows)
    return path


@cases.case("maps of different stands are told from two of one")
def other_stand(folder):
    least, most = [], []
    for seed in (1, 2):
        trees = planted(seed)
        draw = random.Random(100 + seed)
        again = [(x + 0.2 + draw.gauss(0, 0.06), y - 0.1 + draw.gauss(0, 0.06), d + draw.gauss(0, 0.015))
                 for x, y, d in trees if draw.random() > 0.25]
        for diameters in (True, False):
            a = write_measured(folder / "a.csv", trees, diameters)
            for kind, others in (("one", again), ("two", planted(10 + seed))):
                b = write_measured(folder / f"{kind}.csv", others, diameters)
                for align in ((), ("--align",)):
                    done = program("merge", a, b, *align, "-o", folder / "both", "--overwrite", "--json")
                    chance = json.loads(done.stdout)["chance"]
                    assert done.returncode == (0 if kind == "one" else 4), (seed, kind, align, done)
                    told = json.loads((folder / "both" / "run.json").read_text())
                    assert told["status"] == ("complete" if kind == "one" else "untrusted"), told
                    assert kind == "one" or "different stands" in done.stderr, done
                    (least if kind == "one" else most).append(chance["sigmas"])
    return f"{min(least):.1f} sigmas and more for one stand, {max(most):.1f} and less for two"


@cases.case("agreement near a path")
def agreement(folder):
    trees = stand()
    a = write(folder / "a.csv", trees)
    b = write(folder / "b.csv", [tree for k, tree in enumerate(trees) if k % 5])
    path = folder / "trajectory.tum"
    path.write_text("".join(f"{k} {k} 40 0 0 0 0 1\n" for k in range(81)))
    done = program("evaluate", "trees", a, b, "--path", path, "--within-m", 15, "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)["near_path"]
    assert told["paired_b"] == told["trees_b"] == told["paired_a"], told
    expected = 2 * told["paired_a"] / (told["trees_a"] + told["trees_b"])
    assert abs(told["agreement"] - expected) < 1e-12 and 0.8 < expected < 0.95, told


@cases.case("detection over the distance from a path, and two runs compared in parts")
def rates(folder):
    trees = stand(900, 160.0)
    near = [tree for tree in trees if abs(tree[1] - 80) < 12 or (abs(tree[1] - 80) < 30 and tree[0] % 1 < 0.5)]
    a = write(folder / "a.csv", near)
    b = write(folder / "b.csv", trees)
    path, other = folder / "trajectory.tum", folder / "other.tum"
    path.write_text("".join(f"{k} {k} 80 0 0 0 0 1\n" for k in range(161)))
    other.write_text("".join(f"{k} {k} 90 0 0 0 0 1\n" for k in range(161)))
    done = program("evaluate", "trees", a, b, "--path", path, "--bin-m", 6, "--reach-m", 36, "--json")
    assert done.returncode == 0, done.stderr
    rings = json.loads(done.stdout)["by_distance"]
    assert [ring["to_m"] for ring in rings] == [6, 12, 18, 24, 30, 36], rings
    assert rings[0]["recall"] == rings[1]["recall"] == 1 and rings[5]["recall"] == 0, rings
    assert all(0.3 < ring["recall"] < 0.7 for ring in rings[2:5]), rings
    assert all(ring["right"] == ring["reported"] for ring in rings), rings
    turning = [(x, y + 0.6 * (x / 160) ** 2) for x, y in trees]
    c = write(folder / "c.csv", turning)
    done = program("evaluate", "trees", b, c, "--path", path, "--other-path", other, "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)["consistency"]
    assert told["parts"] == 3 and told["trees_a"] > 100, told
    assert told["as_placed"] < 0.8 < 0.95 < told["in_parts"], told
    assert program("evaluate", "trees", b, c, "--other-path", other).returncode == 2
    assert program("evaluate", "trees", b, c, "--bin-m", 5).returncode == 2
    done = program("evaluate", "trees", b, c, "--path", path, "--other-path", folder / "none.tum")
    assert done.returncode == 3 and "none.tum" in done.stderr, done


@cases.case("maps that share nothing, and what is no map")
def nothing(folder):
    a = write(folder / "a.csv", stand(50))
    far = write(folder / "far.csv", [(x + 5000, y) for x, y in stand(50)])
    done = program("merge", a, far, "-o", folder / "both")
    assert done.returncode == 4 and "--align" in done.stderr, done
    copy = write(folder / "copy.csv", stand(50))
    done = program("merge", a, copy, "-o", folder / "twice")
    assert done.returncode == 4 and "both maps hold the same trees" in done.stderr, done
    (folder / "bad.csv").write_text("name\nspruce\n")
    done = program("merge", a, folder / "bad.csv", "-o", folder / "bad")
    assert done.returncode == 3 and "bad.csv" in done.stderr, done
    assert not (folder / "bad").exists()
    assert program("merge", a, "-o", folder / "both").returncode == 2
    run = folder / "run"
    run.mkdir()
    before = write(run / "trees.csv", stand(50)).read_bytes()
    for maps in ((run, a), (a, run / "trees.csv")):
        done = program("merge", *maps, "-o", run)
        assert done.returncode == 3 and "which is read" in done.stderr, done
    assert (run / "trees.csv").read_bytes() == before
    for option in ("--weight", "--reach-m"):
        done = program("merge", a, a, "-o", folder / "both", option, "nan")
        assert done.returncode == 2 and "no finite number" in done.stderr, done


cases.run()
