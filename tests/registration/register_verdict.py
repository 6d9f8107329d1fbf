"""`understory register` ends with exit code 0 only where its answer is right. Clouds of one stand are
matched without a guess, also far from the origin. Clouds of other places and odd ones are refused."""

import json
import math
import random
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program

cases = Cases()
YAW = 1.9  # of the second cloud against the first


def stand(seed, count=90, side=44.0):
    draw = random.Random(seed)
    trees = []
    while len(trees) < count:
        tree = (draw.uniform(0, side), draw.uniform(0, side))
        if all(math.dist(tree, other) > 1.8 for other in trees):
            trees.append(tree)
    return trees


def ground(x, y):
    return 0.05 * x + 0.3 * math.sin(0.4 * y)


def cloud(trees, low, high, seed):
    """What a map shows of the stand between two x: ground, trunks and sparse crowns."""
    draw = random.Random(seed)
    points = []
    for _ in range(14000):
        x, y = draw.uniform(low, high), draw.uniform(0, 44)
        points.append((x, y, ground(x, y) + draw.gauss(0, 0.01)))
    for x, y in trees:
        if not low < x < high:
            continue
        for _ in range(350):
            h, a = draw.uniform(0, 10), draw.uniform(0, 2 * math.pi)
            r = 0.12 + draw.gauss(0, 0.005) if h < 7.5 else draw.uniform(0, 1.2)
            points.append((x + r * math.cos(a), y + r * math.sin(a), ground(x, y) + h))
    return points


def turned(points, yaw, shift):
    c, s = math.cos(yaw), math.sin(yaw)
    return [(c * x - s * y + shift[0], s * x + c * y + shift[1], z + shift[2])
            for x, y, z in points]


def write(path, points):
    head = ("ply\nformat ascii 1.0\n" f"element vertex {len(points)}\n"
            "property double x\nproperty double y\nproperty double z\nend_header\n")
    path.write_text(head + "".join(f"{x:.4f} {y:.4f} {z:.4f}\n" for x, y, z in points))
    return path


def answer(a, b, *options):
    done = program("register", a, b, "--json", *options)
    return done, json.loads(done.stdout) if done.stdout.startswith("{") else None


@cases.case("one stand, without a guess, in two coordinate systems far away")
def far(folder):
    trees = stand(3)
    shift_a, shift_b = (500000.0, 6800000.0, 120.0), (350000.0, 6100000.0, 80.0)
    a = write(folder / "a.ply", turned(cloud(trees, 0, 32, 1), 0.0, shift_a))
    b = write(folder / "b.ply", turned(cloud(trees, 12, 44, 2), YAW, shift_b))
    done, out = answer(a, b, "--method", "global")
    assert done.returncode == 0 and out["verdict"]["trusted"], done.stderr
    matrix = [out["a_from_b"][4 * r:4 * r + 4] for r in range(4)]
    for x, y in ((20.0, 10.0), (25.0, 30.0)):
        source = turned([(x, y, 1.0)], YAW, shift_b)[0]
        target = (x + shift_a[0], y + shift_a[1], 1.0 + shift_a[2])
        found = [sum(m * v for m, v in zip(row, (*source, 1.0))) for row in matrix[:3]]
        assert math.dist(found, target) < 0.1, (found, target)


@cases.case("another stand is refused with a reason, with and without a guess")
def elsewhere(folder):
    a = write(folder / "a.ply", cloud(stand(3), 0, 32, 1))
    b = write(folder / "b.ply", cloud(stand(4), 0, 32, 2))
    for options in (["--method", "global"], ["--method", "ndt"], ["--method", "icp"],
                    ["--method", "gicp", "--guess", "1,2,0"]):
        done, out = answer(a, b, *options)
        assert done.returncode == 4, (options, done.stdout)
        assert not out["verdict"]["trusted"] and out["verdict"]["reason"], options
        assert out["verdict"]["reason"] in done.stderr, done.stderr


@cases.case("a guess off by metres ends right or is refused")
def astray(folder):
    trees = stand(5)
    a = write(folder / "a.ply", cloud(trees, 0, 32, 1))
    b = write(folder / "b.ply", cloud(trees, 6, 38, 2))
    for guess in ("0.2,0.1,0", "2.5,0,0", "0,-4,0", "0,0,0,0,0,0.6,0.8"):
        done, out = answer(a, b, "--guess", guess, "--method", "icp")
        off = math.dist((out["a_from_b"][3], out["a_from_b"][7]), (0, 0))
        assert (done.returncode == 0) <= (off < 0.5), (guess, off, done.stderr)
    done, out = answer(a, b, "--guess", "0.2,0.1,0", "--method", "icp")
    assert done.returncode == 0, done.stderr


@cases.case("clouds without a shape are refused")
def odd(folder):
    draw = random.Random(1)
    a = write(folder / "a.ply", cloud(stand(3), 0, 32, 1))
    flat = [(draw.uniform(0, 30), draw.uniform(0, 30), 0.0) for _ in range(4000)]
    for name, points in (("plane", flat), ("line", [(x, 0.0, 0.0) for x, _, _ in flat]),
                         ("ten", flat[:10]),
                         ("mm", [(1e3 * x, 1e3 * y, 1e3 * z)
                                 for x, y, z in cloud(stand(3), 0, 32, 1)])):
        b = write(folder / f"{name}.ply", points)
        for method in ("global", "ndt"):
            done, out = answer(a, b, "--method", method)
            assert done.returncode == 4 and out["verdict"]["reason"], (name, method, done.stderr)


sys.exit(cases.run())
