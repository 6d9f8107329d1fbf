"""How well a full inventory finds stumps and lying stems, on stands with more of them than sites draw.

    benchmarks/dead_wood.py [--seeds 1 2 4] [--seconds 20] [--near 10] [--work FOLDER]

Site `random` with 200 stumps and 100 lying stems a hectare. Each seed is simulated, mapped by our own SLAM and measured.
Lists are laid on the truth by their paths. Counted are pieces that come within --near metres of the path and show. A
stump shows by 30 points of the map within 3 cm of its surface over the ground, a lying stem by 100. The diameter of a lying stem
is compared in the middle of what was found, that of a stump at its top. Needs numpy and laspy. The program is
build/understory, or the one that UNDERSTORY_PROGRAM names."""

import argparse
import csv
import pathlib
import tempfile

import laspy
import numpy as np

import program
from stem_forms import understory

SETTINGS = ("--set", "stand.stumps_per_ha=200", "--set", "stand.logs_per_ha=100")
LEAST_POINTS = {"stump": 30, "log": 100}
BAND_M = 0.03  # of points on a surface
APART_M = {"stump": 0.25, "log": 0.25}  # of a piece from its true one


def pieces(path):
    with open(path, newline="") as file:
        return [{name: text if name == "kind" else float(text) for name, text in row.items()} for row in csv.DictReader(file)]


def ends(piece):
    return np.array([piece["x"], piece["y"], piece["z"]]), np.array([piece["x_to"], piece["y_to"], piece["z_to"]])


def laid(run, truth):
    """Rotation and translation from the frame of the run into that of the truth, and the true path."""
    own, true = np.loadtxt(run / "trajectory.tum"), np.loadtxt(truth / "trajectory.tum")
    _, i, j = np.intersect1d(own[:, 0].round(2), true[:, 0].round(2), return_indices=True)
    a, b = own[i, 1:4], true[j, 1:4]
    u, _, v = np.linalg.svd((b - b.mean(0)).T @ (a - a.mean(0)))
    rotation = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    return rotation, b.mean(0) - rotation @ a.mean(0), true[:, 1:4]


def along(points, a, b):
    """Of each point its place along the line from a to b, cut at its ends, and its distance from there."""
    length = np.linalg.norm(b - a)
    t = np.clip((points - a) @ ((b - a) / length), 0.0, length)
    return t / length, np.linalg.norm(points - a - np.outer(t / length, b - a), axis=1)


def shows(piece, cloud):
    a, b = ends(piece)
    low, high = np.minimum(a, b) - 0.4, np.maximum(a, b) + 0.4
    near = cloud[np.all((cloud > low) & (cloud < high), axis=1)]
    if not len(near):
        return False
    share, off = along(near, a, b)
    radius = 0.5 * (piece["diameter_m"] + share * (piece["diameter_to_m"] - piece["diameter_m"]))
    on = abs(off - radius) < BAND_M
    if piece["kind"] == "stump":  # the truth begins 20 cm below the ground
        on &= near[:, 2] > a[2] + 0.2
    return on.sum() >= LEAST_POINTS[piece["kind"]]


def distance(piece, other):
    """Of the middle of a piece from another one's line, or of their feet."""
    a, b = ends(other)
    if piece["kind"] == "stump":
        return np.linalg.norm((ends(piece)[0] - a)[:2])
    return along(np.mean(ends(piece), axis=0)[None], a, b)[1][0]


class Tally:
    def __init__(self):
        self.there, self.found, self.false, self.errors, self.in_sd = 0, 0, 0, [], []
        self.lengths, self.volumes = np.zeros(2), np.zeros(2)

    def add(self, true, matches):
        self.there += 1
        self.volumes[0] += volume(true)
        if not matches:
            return
        self.found += 1
        best = max(matches, key=lambda piece: piece["length_m"])
        length = np.linalg.norm(np.subtract(*ends(true)))
        if true["kind"] == "stump":
            said, right = best["diameter_to_m"], true["diameter_to_m"]
            length = length - 0.2 + 0.5 * right  # its top is round
        else:
            said = 0.5 * (best["diameter_m"] + best["diameter_to_m"])
            share = along(np.mean(ends(best), axis=0)[None], *ends(true))[0][0]
            right = true["diameter_m"] + share * (true["diameter_to_m"] - true["diameter_m"])
        self.errors.append(said - right)
        self.in_sd.append((said - right) / best["diameter_sd_m"])
        self.lengths += (length, sum(piece["length_m"] for piece in matches))
        self.volumes[1] += sum(piece["volume_m3"] for piece in matches)

    def report(self, name):
        errors = np.array(self.errors)
        print(f"{name}: {self.found} of {self.there} found, {self.false} false")
        if self.found:
            print(f"  diameter: bias {100 * errors.mean():.1f}, RMSE {100 * np.sqrt((errors ** 2).mean()):.1f}, median error "
                  f"{100 * np.median(abs(errors)):.1f} cm; RMS over sd {np.sqrt(np.mean(np.square(self.in_sd))):.2f}; "
                  f"length {self.lengths[1] / self.lengths[0]:.2f} of the true one of those found; volume "
                  f"{self.volumes[1]:.2f} of {self.volumes[0]:.2f} m3")


def volume(piece):
    a, b = piece["diameter_m"], piece["diameter_to_m"]
    return np.pi / 12 * np.linalg.norm(np.subtract(*ends(piece))) * (a * a + a * b + b * b)


def compare(run, inventory, truth, near_m, tallies):
    rotation, shift, path = laid(run, truth)
    las = laspy.read(run / "map.laz")
    cloud = np.c_[las.x, las.y, las.z] @ rotation.T + shift
    listed = []
    for piece in pieces(inventory / "dead_wood.csv"):
        for names in (("x", "y", "z"), ("x_to", "y_to", "z_to")):
            piece.update(zip(names, rotation @ [piece[name] for name in names] + shift))
        listed.append(piece)
    grown = pieces(truth / "dead_wood.csv")

    def near(piece):
        a, b = ends(piece)
        places = a[:2] + np.linspace(0, 1, 30)[:, None] * (b - a)[:2]
        return min(np.linalg.norm(path[:, :2] - place, axis=1).min() for place in places) <= near_m

    for true in grown:
        if near(true) and shows(true, cloud):
            matches = [one for one in listed if one["kind"] == true["kind"] and distance(one, true) < APART_M[one["kind"]]]
            tallies[true["kind"]].add(true, matches)
    for one in listed:
        if near(one) and all(one["kind"] != true["kind"] or distance(one, true) > APART_M[one["kind"]] for true in grown):
            tallies[one["kind"]].false += 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 4, 5, 6, 8, 9, 10])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--near", type=float, default=10.0)
    parser.add_argument("--work", type=pathlib.Path, help="keeps the maps; a temporary folder otherwise")
    given = parser.parse_args()
    tallies = {"stump": Tally(), "log": Tally()}
    with tempfile.TemporaryDirectory() as scratch:
        work = given.work or pathlib.Path(scratch)
        for seed in given.seeds:
            run, truth = work / f"map-{seed}", work / f"site-{seed}.truth"
            if not run.exists():
                site = work / f"site-{seed}.mcap"
                understory("simulate", "random", "-o", site, "--seed", seed, "--duration-s", given.seconds, *SETTINGS)
                understory("map", site, "-o", run, "--set", "georeference.enabled=false")
                site.unlink()
            understory("inventory", run, "-o", work / f"inventory-{seed}", "--overwrite")
            compare(run, work / f"inventory-{seed}", truth, given.near, tallies)
    for kind, name in (("stump", "stumps"), ("log", "lying stems")):
        tallies[kind].report(name)


if __name__ == "__main__":
    main()
