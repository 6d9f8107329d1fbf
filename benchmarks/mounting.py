"""Does it matter how the body is turned? Maps short simulated walks with the body turned to the 24 orientations of a cube.

    benchmarks/mounting.py [--seed 3] [--seconds 12] [--turns 24] [--ways dense stems stems_alone] [--work FOLDER]

Lidar and IMU stay as they were recorded. The file of extrinsics names another body each time, whose axes
point elsewhere. `dense` maps all points with the IMU and lists the trees of the run again, `stems` maps
by stems with the IMU, `stems_alone` without. Prints the error of the path and of the trees against the
truth. It also prints how far both are from those of the body that stands upright. The program is
build/understory, or the one that UNDERSTORY_PROGRAM names. Python's standard library only."""

import argparse
import itertools
import json
import math
import pathlib
import tempfile

import program

SITE = ("demo", "--set", "lidar.model=VLP-16", "--set", "gnss.enabled=false", "--set", "carrier.still_s=1")
WAYS = {"dense": (), "stems": ("--front-end", "sparse"),
        "stems_alone": ("--front-end", "sparse", "--set", "stems.imu.use=false")}
LIDAR_M = (0, 0, 0.06)  # of the site


def orientations():
    """The 24 rotations that take the axes of a cube to each other, as rows of a matrix; the first turns nothing."""
    found = []
    for columns in itertools.permutations(range(3)):
        for signs in itertools.product((1, -1), repeat=3):
            rows = [[signs[i] if columns[i] == j else 0 for j in range(3)] for i in range(3)]
            even = sum(columns[i] > columns[j] for i in range(3) for j in range(i, 3)) % 2 == 0
            if math.prod(signs) == (1 if even else -1):
                found.append(rows)
    return sorted(found, key=lambda rows: rows[0][0] + rows[1][1] + rows[2][2], reverse=True)


def write_extrinsics(path, turn, lidar_m):
    """The sensors on a body that is turned by `turn` against that of the simulation, where the IMU is the body."""
    flat = [value for row in turn for value in row]
    place = [sum(row[k] * lidar_m[k] for k in range(3)) for row in turn]
    path.write_text(f"body_frame: turned\n"
                    f"body_from_lidar: {{translation_m: {place}, matrix: {flat}}}\n"
                    f"body_from_imu: {{translation_m: [0, 0, 0], matrix: {flat}}}\n")


def evaluated(*words):
    done = program.run(program.PROGRAM, "--quiet", "evaluate", *words, "--json")
    assert done.code == 0, done.stderr
    return json.loads(done.stdout)


def trees_of(folder, truth):
    """Trees of a run that are right, and the error of their places, metres."""
    told = evaluated("trees", folder, truth, "--align", "yaw")
    return told["matched"], told["position_rmse_m"]


def mapped(recording, folder, extrinsics, way):
    """The exit code of a run, the error of its path in metres, and its trees."""
    done = program.run(program.PROGRAM, "--quiet", "map", recording, "-o", folder, "--extrinsics", extrinsics,
                       "--overwrite", "--threads", 2, *WAYS[way])
    assert done.code in (0, 4), f"{folder}: {done.stderr}"
    truth = recording.with_suffix(".truth")
    return done.code, evaluated(folder, truth, "--align", "se3")["ape_rmse_m"], trees_of(folder, truth)


def listed_again(recording, folder):
    """The trees of `understory inventory` of a dense run."""
    done = program.run(program.PROGRAM, "--quiet", "inventory", folder, "-o", f"{folder}i", "--overwrite",
                       "--threads", 2)
    assert done.code in (0, 4), f"{folder}: {done.stderr}"
    return trees_of(f"{folder}i", recording.with_suffix(".truth"))


def recorded(work, seed, seconds):
    recording = work / f"walk{seed}.mcap"
    if not recording.exists():
        done = program.run(program.PROGRAM, "--quiet", "simulate", *SITE, "-o", recording, "--seed", seed,
                           "--duration-s", seconds)
        assert done.code == 0, done.stderr
    return recording


def runs(recording, work, way, turns):
    """For each orientation, the upright first: its number, exit code, error of the path, trees."""
    for number in dict.fromkeys([0, *turns]):
        extrinsics, folder = work / f"turn{number}.yaml", work / f"{way}{number}"
        write_extrinsics(extrinsics, orientations()[number], LIDAR_M)
        code, error, trees = mapped(recording, folder, extrinsics, way)
        yield number, code, error, trees
        if way == "dense":
            yield number, code, error, listed_again(recording, folder)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=12)
    parser.add_argument("--turns", type=int, nargs="*", default=range(24), help="which of the 24 orientations")
    parser.add_argument("--ways", nargs="*", default=list(WAYS), choices=list(WAYS))
    parser.add_argument("--work", type=pathlib.Path)
    options = parser.parse_args()
    work = options.work or pathlib.Path(tempfile.mkdtemp())
    work.mkdir(parents=True, exist_ok=True)
    recording = recorded(work, options.seed, options.seconds)
    print("way          turn  exit  path_cm  off_cm  trees  tree_cm  off_cm")
    for way in options.ways:
        first = None
        for number, code, error, (trees, tree_error) in runs(recording, work, way, options.turns):
            first = first or (error, tree_error)
            print(f"{way:12} {number:4}  {code:4}  {100 * error:7.2f}  {100 * (error - first[0]):6.2f}  {trees:5}  "
                  f"{100 * tree_error:7.2f}  {100 * (tree_error - first[1]):6.2f}", flush=True)


if __name__ == "__main__":
    main()
