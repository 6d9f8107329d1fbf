"""`understory register` of sparse clouds: stems by trimmed ICP and by branch and bound. The guess is
good, wrong or absent, and some clouds are not sparse."""

import json
import math
import random
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program

cases = Cases()
YAW, SHIFT = math.radians(25.0), (2.5, -1.5, 0.3)


def write(path, points):
    path.write_text("# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
                    f"WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\n"
                    "DATA ascii\n" + "".join("{:.4f} {:.4f} {:.4f}\n".format(*p) for p in points))
    return path


def stand(count=130, reach=35.0):
    draw = random.Random(3)
    trees = []
    while len(trees) < count:
        x, y = draw.uniform(-reach, reach), draw.uniform(-reach, reach)
        if math.hypot(x, y) < reach and all(math.hypot(x - p, y - q) > 2.0 for p, q, _ in trees):
            trees.append((x, y, draw.uniform(-0.5, 0.5)))
    return trees


def seen(trees, seed, a_from_b=(0.0, (0.0, 0.0, 0.0))):
    """With 5 cm of noise, each fifth tree missed, in the frame of B."""
    draw = random.Random(seed)
    yaw, shift = a_from_b
    points = []
    for tree in trees:
        if draw.random() < 0.2:
            continue
        x, y, z = (value - s + draw.gauss(0, 0.05) for value, s in zip(tree, shift))
        points.append((math.cos(yaw) * x + math.sin(yaw) * y, math.cos(yaw) * y - math.sin(yaw) * x, z))
    return points


A = write(cases.folder / "a.pcd", seen(stand(), 1))
B = write(cases.folder / "b.pcd", seen(stand(), 2, (YAW, SHIFT)))


def matched(*options, code=0):
    done = program("register", A, B, *options, "--json")
    assert done.returncode == code, (done.returncode, done.stderr)
    return json.loads(done.stdout)


def errors(told):
    """Of the place in metres, of the yaw in degrees."""
    t = told["a_from_b"]
    return math.dist((t[3], t[7]), SHIFT[:2]), abs(math.degrees(math.atan2(t[4], t[0]) - YAW))


@cases.case("go-icp finds it without a guess and certifies the gap")
def certified(folder):
    told = matched("--method", "go-icp")
    shift, yaw = errors(told)
    assert told["status"] == "certified" and 0 <= told["gap_m"] <= 0.02, told
    assert len(told["a_from_b"]) == 16 and shift < 0.05 and yaw < 0.3, (shift, yaw)
    assert told["overlap"] > 0.6 and told["nodes"] > 10, told
    paper = matched("--method", "go-icp", "--set", "go_icp.mode=paper")
    assert paper["status"] == "converged" and errors(paper)[0] < 0.05, paper
    return f"{100 * shift:.1f} cm, {yaw:.2f} degrees, {told['nodes']} boxes"


@cases.case("go-icp in space levels a view that leans")
def leaning(folder):
    lean = math.radians(9.0)
    trees = [(x, math.cos(lean) * y - math.sin(lean) * z, math.sin(lean) * y + math.cos(lean) * z)
             for x, y, z in seen(stand(), 2, (YAW, SHIFT))]
    tilted = write(folder / "tilted.pcd", trees)
    done = program("register", A, tilted, "--method", "go-icp", "--json", "--set",
                   "go_icp.motion=space", "--set", "go_icp.mode=paper", "--set",
                   "go_icp.yaw_range_deg=60", "--set", "go_icp.shift_range_m=3")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    t = told["a_from_b"]
    assert told["status"] == "converged" and math.dist((t[3], t[7]), SHIFT[:2]) < 0.1, told
    # What B's vertical became: A's z axis, leant back by 9 degrees.
    assert abs(math.degrees(math.acos(t[10])) - 9.0) < 0.3, t
    flat = json.loads(program("register", A, tilted, "--method", "go-icp", "--json", "--set",
                              "go_icp.refine=false", "--set", "go_icp.gap_m=0.2").stdout)
    assert abs(flat["a_from_b"][10] - 1.0) < 1e-9, flat  # the plane's search leaves it as it is
    return f"{told['nodes']} boxes"


@cases.case("stem-icp comes home from within its region, and says so where it does not")
def trimmed(folder):
    guess = f"{SHIFT[0] + 0.4},{SHIFT[1] - 0.3},0,0,0,{math.sin(YAW / 2 + 0.02):.6f},{math.cos(YAW / 2 + 0.02):.6f}"
    told = matched("--method", "stem-icp", "--guess", guess)
    shift, yaw = errors(told)
    assert told["status"] == "converged" and shift < 0.05 and yaw < 0.3, told
    assert told["overlap"] + told["outlier_ratio"] == 1.0 and 0.02 < told["error_m"] < 0.2, told
    assert abs(told["a_from_b"][11] - SHIFT[2]) < 0.1, told["a_from_b"]
    # In the plane height stays as guessed.
    plane = matched("--method", "stem-icp", "--guess", guess, "--set", "stem_icp.metric=plane")
    assert errors(plane)[0] < 0.05 and abs(plane["a_from_b"][11]) < 1e-9, plane
    lost = matched("--method", "stem-icp", code=4)
    assert errors(lost)[0] > 0.5, lost
    done = program("register", A, B, "--method", "stem-icp", "--guess", guess)
    assert done.returncode == 0 and "overlap 0." in done.stdout and "status converged" in done.stdout
    return f"{100 * shift:.1f} cm, {yaw:.2f} degrees, error {100 * told['error_m']:.1f} cm"


@cases.case("clouds that are not sparse, or too sparse")
def wrong(folder):
    draw = random.Random(4)
    dense = write(folder / "dense.pcd", [tuple(draw.uniform(-9, 9) for _ in range(3)) for _ in range(6000)])
    few = write(folder / "few.pcd", stand()[:4])
    # The best of a range that holds no match is certified, and no match.
    far = matched("--method", "go-icp", "--guess", "1e9,0,0", code=4)
    assert far["overlap"] < 0.1 and "little overlap" in far["reason"], far
    assert abs(far["a_from_b"][3] - 1e9) < 10, far
    scrap = write(folder / "scrap.pcd", seen(stand(), 7)[:20])
    lone = json.loads(program("register", A, scrap, "--method", "go-icp", "--json", "--guess", "60,0,0").stdout)
    assert lone["overlap"] < 0.4 and lone["reason"], lone
    for method in ("go-icp", "stem-icp"):
        done = program("register", A, dense, "--method", method)
        assert done.returncode == 3 and "dense.pcd" in done.stderr and "5000" in done.stderr, done
        done = program("register", A, few, "--method", method)
        assert done.returncode == 4 and "stems" in done.stderr, done
    assert program("register", A, B, "--method", "stem-icp", "--set", "stem_icp.metric=up").returncode == 2
    for guess in ("1,nan,0", "1,inf,0"):
        done = program("register", A, B, "--method", "stem-icp", "--guess", guess)
        assert done.returncode == 2 and "--guess" in done.stderr, done


cases.run()
