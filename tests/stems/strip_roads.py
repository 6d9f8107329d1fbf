"""A harvester's strip roads through a made-up stand, seen as stems: stems.csv.gz and the truth.

Three roads of 180 m lie 22.5 m apart and are driven there, back and there again, as the site of
Nevalainen et al. 2020 was; the cabin swings, so a view of 210 degrees looks everywhere in turn. It holds
what a detector gets wrong: noise that grows with the range, centres drawn to the scanner, and feet that
look higher with distance. It also misses stems, hides them behind others, and adds bushes and false
stems. Every number hangs on the seed alone. Standard library only.
"""

import gzip
import math
import random
from dataclasses import dataclass

VIEW_DEG, RANGE_M, SCANNER_M = 210.0, 40.0, 2.5


@dataclass
class Roads:
    roads: int = 3
    length_m: float = 180.0
    apart_m: float = 22.5
    step_m: float = 0.6
    swing_deg: float = 55.0
    swing_views: float = 26.0
    tilt_deg: float = 1.0
    trees_per_ha: float = 770.0
    noise_m: float = 0.03
    noise_per_m: float = 0.0007
    bias_m: float = 0.015        # centres drawn to the scanner
    missed: float = 0.08         # near; more with the range
    false_share: float = 0.06
    bushes_per_ha: float = 30.0


@dataclass
class Tree:
    x: float
    y: float
    z: float
    radius: float
    axis: tuple
    bush: bool


def ground(x, y):
    return 0.038 * x + 0.9 * math.sin(x / 11.0) * math.cos(y / 13.0)


def normalised(v):
    length = math.sqrt(sum(c * c for c in v))
    return tuple(c / length for c in v)


def path(roads):
    """Positions in the plane and headings, a step apart, with the half circles between the roads."""
    points, radius = [], 0.5 * roads.apart_m
    for k in range(roads.roads):
        count = int(roads.length_m / 0.1)
        for i in range(count):
            x = i * 0.1
            y = k * roads.apart_m + 1.2 * math.sin(2 * math.pi * x / 70.0 + k)
            points.append((x if k % 2 == 0 else roads.length_m - x, y))
        if k + 1 == roads.roads:
            break
        end = points[-1]
        side = 1.0 if k % 2 == 0 else -1.0
        next_y = (k + 1) * roads.apart_m + 1.2 * math.sin(k + 1)
        radius = 0.5 * (next_y - end[1])
        for i in range(1, int(math.pi * radius / 0.1)):
            a = -0.5 * math.pi + 0.1 * i / radius
            points.append((end[0] + side * radius * math.cos(a), end[1] + radius * (1 + math.sin(a))))
    every = max(1, round(roads.step_m / 0.1))
    kept = points[::every]
    headings = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in zip(kept, kept[1:])]
    return list(zip(kept, headings + headings[-1:]))


def stand(roads, way, rng):
    """Trees at least 1.4 m apart and clear of the path."""
    margin, trees, cells, driven = 45.0, [], {}, set()
    for (x, y), _ in way:
        driven.update((int(x // 2) + i, int(y // 2) + j) for i in (-1, 0, 1) for j in (-1, 0, 1))
    size_x = roads.length_m + 2 * margin
    size_y = (roads.roads - 1) * roads.apart_m + 2 * margin
    for per_ha, bush in ((roads.trees_per_ha, False), (roads.bushes_per_ha, True)):
        for _ in range(int(per_ha * size_x * size_y / 1e4)):
            x, y = rng.uniform(-margin, size_x - margin), rng.uniform(-margin, size_y - margin)
            cell = (int(x // 1.4), int(y // 1.4))
            near = (t for i in (-1, 0, 1) for j in (-1, 0, 1)
                    for t in cells.get((cell[0] + i, cell[1] + j), ()))
            if (int(x // 2), int(y // 2)) in driven:
                continue
            if any(math.hypot(t.x - x, t.y - y) < 1.4 for t in near):
                continue
            lean = math.radians(1.8)
            axis = normalised((rng.gauss(0.008, lean), rng.gauss(0, lean), 1.0))
            tree = Tree(x, y, ground(x, y), 0.5 * max(0.08, rng.gauss(0.18, 0.05)), axis, bush)
            cells.setdefault(cell, []).append(tree)
            trees.append(tree)
    return trees


def rotation(yaw, pitch, roll):
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    cr, sr = math.cos(roll), math.sin(roll)
    return ((cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
            (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
            (-sp, cp * sr, cp * cr))


def quaternion(yaw, pitch, roll):
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    return (cy * cp * sr - sy * sp * cr, cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr, cy * cp * cr + sy * sp * sr)


def turned_back(matrix, v):
    """By the transpose: from the world's axes to the body's."""
    return tuple(sum(matrix[i][j] * v[i] for i in range(3)) for j in range(3))


def seen(roads, trees, at, turn, rng):
    """The rows of one view, in the body frame."""
    near = []
    for tree in trees:
        dx, dy = tree.x - at[0], tree.y - at[1]
        if abs(dx) > RANGE_M or abs(dy) > RANGE_M:
            continue
        reach = math.hypot(dx, dy)
        if 1.0 < reach < RANGE_M:
            near.append((reach, math.atan2(dy, dx), tree))
    near.sort(key=lambda n: n[0])
    rows, hidden = [], []
    for reach, bearing, tree in near:
        width = tree.radius / reach
        if any(abs(math.remainder(bearing - b, 2 * math.pi)) < w for b, w in hidden):
            continue
        hidden.append((bearing, width))
        if rng.random() < roads.missed + 0.6 * (reach / RANGE_M) ** 2:
            continue
        sd = (roads.noise_m + roads.noise_per_m * reach) * (6.0 if tree.bush else 1.0)
        drawn = reach - roads.bias_m
        p = (at[0] + drawn * math.cos(bearing) + rng.gauss(0, sd),
             at[1] + drawn * math.sin(bearing) + rng.gauss(0, sd),
             tree.z + 0.004 * reach + rng.gauss(0, 0.08 + 0.003 * reach))
        in_body = turned_back(turn, tuple(a - b for a, b in zip(p, at)))
        if abs(math.atan2(in_body[1], in_body[0])) > math.radians(VIEW_DEG / 2):
            continue
        axis = normalised(tuple(a + rng.gauss(0, 0.035) for a in tree.axis))
        rows.append((in_body, turned_back(turn, axis), 2 * tree.radius + rng.gauss(0, 0.02),
                     min(1.0, rng.gauss(0.5 if tree.bush else 0.9, 0.12))))
    for _ in range(int(roads.false_share * len(rows) + rng.random())):
        a, r = rng.uniform(-VIEW_DEG / 2, VIEW_DEG / 2), RANGE_M * math.sqrt(rng.random())
        axis = normalised((rng.gauss(0, 0.15), rng.gauss(0, 0.15), 1.0))
        point = (r * math.cos(math.radians(a)), r * math.sin(math.radians(a)),
                 rng.gauss(-SCANNER_M, 0.7))
        rows.append((point, axis, rng.uniform(0.06, 0.3),
                     min(1.0, rng.gauss(0.45, 0.15))))
    return rows


def write_packed(path, rows):
    with open(path, "wb") as raw, gzip.GzipFile("", "wb", 6, raw, 0) as packed:  # no name, no time
        packed.write(("\n".join(rows) + "\n").encode())


def rows_of(k, stamp, view):
    return [f"{k},{stamp:.2f}," + ",".join(f"{v:.4f}" for v in (*p, *axis, dbh, score))
            for p, axis, dbh, score in view]


def write_strip_roads(folder, seed, roads=None, second_look=False):
    """Writes stems.csv.gz, and truth/trajectory.tum and truth/trees.csv. Returns number of views.

    With a second look, second_look.csv.gz has the same trees from the same poses, with other noise.
    """
    roads = roads or Roads()
    rng, other = random.Random(seed), random.Random(f"second look {seed}")
    way = path(roads)
    trees = stand(roads, way, rng)
    truth = folder / "truth"
    truth.mkdir(parents=True, exist_ok=True)
    rows = ["frame,timestamp,x,y,z,axis_x,axis_y,axis_z,dbh_m,score"]
    second = rows[:]
    poses, tilt = [], [0.0, 0.0]
    for k, ((x, y), heading) in enumerate(way):
        swing = math.radians(roads.swing_deg) * math.sin(2 * math.pi * k / roads.swing_views)
        tilt = [0.8 * t + rng.gauss(0, 0.6 * math.radians(roads.tilt_deg)) for t in tilt]
        angles = (heading + swing, tilt[0], tilt[1])
        at = (x, y, ground(x, y) + SCANNER_M)
        stamp = 0.5 * k
        poses.append(" ".join(f"{v:.9f}" for v in (stamp, *at, *quaternion(*angles))))
        rows += rows_of(k, stamp, seen(roads, trees, at, rotation(*angles), rng))
        if second_look:
            second += rows_of(k, stamp, seen(roads, trees, at, rotation(*angles), other))
    (truth / "trajectory.tum").write_text("\n".join(poses) + "\n")
    (truth / "trees.csv").write_text("\n".join(
        ["id,x,y,z,dbh_m"] + [f"{i},{t.x:.4f},{t.y:.4f},{t.z:.4f},{2 * t.radius:.4f}"
                              for i, t in enumerate(trees) if not t.bush]) + "\n")
    write_packed(folder / "stems.csv.gz", rows)
    if second_look:
        write_packed(folder / "second_look.csv.gz", second)
    return len(way)
