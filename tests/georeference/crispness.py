"""A map stays crisp when bad positions by satellites enter its graph. With bursts and jumps its cloud
has the entropy of the cloud without them, and its path the error. What is called its entropy is the one
of the definition, and tells a blurred cloud from a crisp one."""

import json
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import SMALL_STAND, Cases, program, simulated

import laspy
import numpy

cases = Cases()
MOST_NATS = 0.02
MOST_APE = (1.05, 0.001)  # times that without positions, and metres more
SITE = ("lidar.model=VLP-16", "gnss.jump_interval_s=10", "gnss.jump_m=10", "gnss.burst_interval_s=15", "gnss.burst_m=10",
        *SMALL_STAND)


def answer(*words):
    done = program(*words, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@cases.case("with bursts and jumps fused, the cloud is as crisp and the path as good as without positions")
def crisp(folder):
    walk = simulated("demo", 7, 25, *SITE)
    entropy, ape = {}, {}
    for use in ("georeference", "fuse"):
        run = folder / use
        done = program("map", walk, "-o", run, "--set", f"gnss.use={use}")
        assert done.returncode in (0, 4), done.stderr
        entropy[use] = answer("evaluate", "map", run)["mean_entropy_nats"]
        ape[use] = answer("evaluate", run, walk.with_suffix(".truth"), "--align", "se3")["ape_rmse_m"]
    print(entropy, ape)
    # The positions were there, and counted: else the clouds would be alike without proof.
    facts = json.loads((folder / "fuse" / "run.json").read_text())
    assert facts["quality"]["gnss_factors"] > 20 and facts["quality"]["gnss_bent_m"] > 0, facts["quality"]
    assert abs(entropy["fuse"] - entropy["georeference"]) <= MOST_NATS, entropy
    assert ape["fuse"] <= MOST_APE[0] * ape["georeference"] + MOST_APE[1], ape


def by_definition(points, radius_m):
    """Mean over the points of 0.5 ln det(2 pi e S), S from the neighbours nearer than the radius; and their number."""
    entropies = []
    for point in points:
        near = points[((points - point) ** 2).sum(axis=1) < radius_m ** 2]
        if len(near) >= 10:
            spread = numpy.cov(near.T, bias=True) + 1e-6 * numpy.eye(3)
            entropies.append(0.5 * math.log(numpy.linalg.det(2 * math.pi * math.e * spread)))
    return sum(entropies) / len(entropies), len(entropies)


def written(path, points):
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = numpy.floor(points.min(axis=0)), [0.001] * 3
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    cloud.write(path)
    return numpy.column_stack((cloud.x, cloud.y, cloud.z))


@cases.case("the entropy of a piece of the cloud is that of the definition, for any radius, and grows where it blurs")
def definition(folder):
    run = folder / "run"
    walk = simulated("demo", 7, 8, "lidar.model=VLP-16", "stand.size_x_m=40", "stand.size_y_m=40")
    done = program("map", walk, "-o", run)
    assert done.returncode in (0, 4), done.stderr
    cloud = laspy.read(run / "map.laz")
    points = numpy.column_stack((cloud.x, cloud.y, cloud.z))
    # The fullest square of 2 m: ground, stems and what lies on it.
    squares, counts = numpy.unique(numpy.floor(points[:, :2] / 2), axis=0, return_counts=True)
    square = squares[counts.argmax()]
    points = points[(numpy.floor(points[:, :2] / 2) == square).all(axis=1)][:6000]
    assert len(points) > 1000, len(points)
    piece = written(folder / "piece.las", points)
    for radius in (0.3, 0.5):
        told = answer("evaluate", "map", folder / "piece.las", "--radius-m", radius, "--thin-m", 0)
        mean, used = by_definition(piece, radius)
        assert told["points"] == len(piece) and abs(told["points_used"] - used) <= 2, (told, used)
        assert abs(told["mean_entropy_nats"] - mean) < 0.002, (radius, told, mean)
    assert answer("evaluate", "map", folder / "piece.las")["mean_entropy_nats"] == answer(
        "evaluate", "map", folder / "piece.las", "--radius-m", 0.3, "--thin-m", 0.05)["mean_entropy_nats"]
    # Two passes that lie 7 cm apart are seen.
    doubled = numpy.vstack((piece, piece + [0.04, 0.04, 0.04]))
    written(folder / "doubled.las", numpy.vstack((piece, piece)))
    written(folder / "blurred.las", doubled)
    crisp_one, blurred = (answer("evaluate", "map", folder / f"{name}.las")["mean_entropy_nats"]
                          for name in ("doubled", "blurred"))
    print(f"{len(piece)} points: crisp {crisp_one:.3f} nats, two passes 7 cm apart {blurred:.3f}")
    assert blurred > crisp_one + 2 * MOST_NATS, (crisp_one, blurred)


@cases.case("a folder without a cloud is named")
def no_cloud(folder):
    done = program("evaluate", "map", folder)
    assert done.returncode == 3 and "map.laz" in done.stderr, done.stderr


if __name__ == "__main__":
    sys.exit(cases.run())
