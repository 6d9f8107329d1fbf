"""What benchmarks/inventory_table.py reads of a truth beside its trees: the things that are no trees
(objects.csv), and the tree of each point (points.laz). Needs numpy, and laspy for points."""
import csv
import math
import os

import numpy as np

# A false stem stands on a thing whose rectangle it is in, or nearer to than this (m).
ON_OBJECT_M = 0.35
# A false stem beside a true tree that another one of the list is the same as (m).
BESIDE_TREE_M = 1.0
# A point of the map is one of the truth if their times are the same (SAME_TIME) and they lie so near (m).
SAME_POINT_M = 0.5
# The same before the map's offset is known (m).
ROUGH_POINT_M = 3.0
# The top of a tree is seen where the truth has so many points in the half metre below it.
TOP_M = 0.5
TOP_POINTS = 5
# Points of a map that are compared with the truth at most: evenly taken from all.
MOST_POINTS = 200_000
# Seconds of which a point's time is a whole number, for comparison.
TICK_S = 1e-6
# Ticks by which two times of the same point differ at most: the map rounds its times to 10 ticks.
SAME_TIME = 11


def things_of(folder):
    """The rows of objects.csv as dictionaries with numbers; none where there is no such file."""
    path = f"{folder}/objects.csv"
    if not os.path.exists(path):
        return []
    with open(path, newline="") as file:
        return [{key: text if key == "kind" else float(text) for key, text in row.items()} for row in csv.DictReader(file)]


def gap_to(thing, place):
    """How far a place in the plane is outside of the rectangle of a thing; of a walker, of its line."""
    turn = math.radians(thing["yaw_deg"])
    dx, dy = place[0] - thing["x"], place[1] - thing["y"]
    along = abs(dx * math.cos(turn) + dy * math.sin(turn)) - 0.5 * (thing["length_m"] + thing["walk_m"])
    across = abs(-dx * math.sin(turn) + dy * math.cos(turn)) - 0.5 * thing["width_m"]
    return math.hypot(max(along, 0.0), max(across, 0.0))


def kind_of_false(place, things, truth_places, path):
    """On what a stem stands that is no tree of the truth."""
    gaps = [(gap_to(thing, place), thing["kind"]) for thing in things]
    if gaps and min(gaps)[0] <= ON_OBJECT_M:
        return min(gaps)[1]
    if len(truth_places) and np.hypot(*(truth_places - place).T).min() <= BESIDE_TREE_M:
        return "beside a tree"
    if np.hypot(*(path - place).T).min() < 1.0:
        return "on the path"
    return "plants and the rest"


def read_points(path):
    """x, y, z (n x 3), time in ticks and tree_id of the points of a LAZ file."""
    import laspy

    cloud = laspy.read(path)
    ticks = np.round(np.asarray(cloud.gps_time) / TICK_S).astype(np.int64)
    return np.column_stack([cloud.x, cloud.y, cloud.z]), ticks, np.asarray(cloud.tree_id).astype(np.int64)


def thinned(points):
    """Every so-manieth point, so that MOST_POINTS are left at most."""
    step = -(-len(points[0]) // MOST_POINTS)
    return tuple(part[::step] for part in points)


def nearest_at_its_time(places, ticks, true_points, reach_m):
    """Index of the truth's nearest point of the same time, within reach; -1 where there is none. The truth is sorted by time."""
    true_places, true_ticks, _ = true_points
    begin = np.searchsorted(true_ticks, ticks - SAME_TIME, "left")
    count = np.searchsorted(true_ticks, ticks + SAME_TIME, "right") - begin
    best = np.full(len(ticks), reach_m ** 2)
    found = np.full(len(ticks), -1, dtype=np.int64)
    for step in range(int(count.max(initial=0))):
        some = np.flatnonzero(count > step)
        there = begin[some] + step
        squared = ((places[some] - true_places[there]) ** 2).sum(axis=1)
        nearer = squared < best[some]
        best[some[nearer]] = squared[nearer]
        found[some[nearer]] = there[nearer]
    return found


def true_trees_of(places, ticks, true_points):
    """The true tree of each point of a map in the frame of the truth; -1 where there is none. The feet of the trees lay
    the map on the truth, and the ground around them may be seen too high. So the median offset is taken off first."""
    if (np.diff(true_points[1]) < 0).any():
        order = np.argsort(true_points[1], kind="stable")
        true_points = tuple(part[order] for part in true_points)
    rough = nearest_at_its_time(places, ticks, true_points, ROUGH_POINT_M)
    if not (rough >= 0).any():
        return rough
    offset = np.median(places[rough >= 0] - true_points[0][rough[rough >= 0]], axis=0)
    found = nearest_at_its_time(places - offset, ticks, true_points, SAME_POINT_M)
    return np.where(found >= 0, true_points[2][found], -1)


def tops_seen(true_points, ids, tops_z):
    """Whether the points of each tree reach its top: TOP_POINTS of them in the last TOP_M."""
    places, _, points_ids = true_points
    top_of = np.full(int(max(ids.max(initial=0), points_ids.max(initial=0))) + 1, np.inf)
    top_of[ids] = tops_z
    high = places[:, 2] > top_of[points_ids] - TOP_M
    return np.bincount(points_ids[high], minlength=len(top_of))[ids] >= TOP_POINTS
