"""A carrier that stands for long adds no rings to the map (P3, section 5.2: "circular artifacts" of its prior maps).

A sleigh drives, stands for 25 s and drives on. The figure is the share of the map's points that lie
more than 5 cm off all true points. Points measured while it stood must have no higher share than the
others. True points have the lidar's noise, too, so that the distance to the nearest one is what the path
adds.
"""

import csv
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program, simulated

import laspy
import numpy

cases = Cases()
STAND_S = 25
SITE = ["carrier.route=strip", "carrier.one_way=true", "carrier.length_m=36", "carrier.halts=1",
        f"carrier.halt_s={STAND_S}", "carrier.route_time_s=0", "lidar.rate_hz=5", "lidar.snow_fall_per_m=0",
        "lidar.snow_drop_interval_s=0", "lidar.crosstalk=0", "truth.points=true", "stand.size_x_m=280", "stand.size_y_m=280"]
OFF_M = 0.05
STILL_M_S = 0.05
CELL_M = 0.06  # of the search for the nearest true point, above OFF_M
MOST = 20_000  # points of each part that are looked at


def read(path):
    cloud = laspy.read(path)
    return (numpy.column_stack((cloud.x, cloud.y, cloud.z)), numpy.asarray(cloud.gps_time),
            numpy.asarray(cloud.intensity))


def fitted(some, others):
    """The motion and scale (that of the map's projection) of least squares that bring the first points onto the second."""
    a, b = some.mean(axis=0), others.mean(axis=0)
    u, s, v = numpy.linalg.svd((some - a).T @ (others - b))
    turn = v.T @ numpy.diag([1.0, 1.0, numpy.sign(numpy.linalg.det(v.T @ u.T))]) @ u.T
    scale = s.sum() / ((some - a) ** 2).sum()
    return lambda points: scale * (points - a) @ turn.T + b


def laid_on(some, others):
    """The same without the pairs that are none: points of one time are not always of one beam."""
    use = numpy.ones(len(some), dtype=bool)
    for _ in range(6):
        move = fitted(some[use], others[use])
        gaps = numpy.linalg.norm(move(some) - others, axis=1)
        use = gaps < 3 * numpy.median(gaps)
    return move, float(numpy.median(gaps))


def poses(path):
    return numpy.array([[float(cell) for cell in line.split()] for line in path.read_text().splitlines()
                        if line[0] in "0123456789"])


def far_from_all(places, true_places, reach):
    """Whether each place has no true point within the reach."""
    def cells(points, step):
        c = numpy.floor(points / CELL_M).astype(numpy.int64) + step
        return (c[:, 0] * 73856093) ^ (c[:, 1] * 19349663) ^ (c[:, 2] * 83492791)
    keys = cells(true_places, 0)
    order = numpy.argsort(keys, kind="stable")
    keys, sorted_places = keys[order], true_places[order]
    near = numpy.zeros(len(places), dtype=bool)
    for step in numpy.ndindex(3, 3, 3):
        some = numpy.flatnonzero(~near)
        wanted = cells(places[some], numpy.array(step) - 1)
        begin = numpy.searchsorted(keys, wanted, "left")
        count = numpy.searchsorted(keys, wanted, "right") - begin
        for k in range(int(count.max(initial=0))):
            left = numpy.flatnonzero((count > k) & ~near[some])
            if len(left) == 0:
                break
            gap = ((places[some[left]] - sorted_places[begin[left] + k]) ** 2).sum(axis=1)
            near[some[left[gap < reach ** 2]]] = True
    return ~near


@cases.case("the map has no more points off its surfaces from long standing than from the way")
def no_rings(folder):
    ride = simulated("skidoo", 4, 0, *SITE)  # 0: as long as the route takes
    true_folder = ride.with_suffix(".truth")
    # All that the scans saw, not only the first point of each cube.
    done = program("map", ride, "-o", folder / "run", "--profile", "sleigh", "--set", "map.thin_m=0")
    assert done.returncode in (0, 4), done.stderr
    mine, truth = poses(folder / "run" / "trajectory.tum"), poses(true_folder / "trajectory.tum")
    both, i, j = numpy.intersect1d(mine[:, 0].round(3), truth[:, 0].round(3), return_indices=True)
    assert len(both) > 100, len(both)
    with open(true_folder / "velocity.csv", newline="") as file:
        speeds = numpy.array([[float(cell) for cell in row] for row in list(csv.reader(file))[1:]])
    still = speeds[numpy.linalg.norm(speeds[:, 1:4], axis=1) < STILL_M_S, 0]
    places, times, bright = read(folder / "run" / "map.laz")
    true_places, true_times, true_bright = read(true_folder / "points.laz")
    # Points of one time and brightness lay the map on the truth.
    _, a, b = numpy.intersect1d(times.round(7), true_times.round(7), return_indices=True)
    same = bright[a] == true_bright[b]
    assert same.sum() > 10000, same.sum()
    move, gap = laid_on(places[a][same], true_places[b][same])
    assert gap < 0.02, gap
    places = move(places)
    # The clock of LAS files begins elsewhere; scans tell by how much.
    times = times - (true_times.min() - truth[0, 0])
    stood = numpy.interp(times, speeds[:, 0], numpy.linalg.norm(speeds[:, 1:4], axis=1)) < STILL_M_S
    assert still[-1] - still[0] > STAND_S - 5 and stood.sum() > 1000 and (~stood).sum() > 1000, (stood.sum(), len(stood))
    picked = [part[::-(-len(part) // MOST)] for part in (places[stood], places[~stood])]
    far = far_from_all(numpy.concatenate(picked), true_places, OFF_M)
    shares = [far[:len(picked[0])].mean(), far[len(picked[0]):].mean()]
    print(f"off by more than 5 cm: {100 * shares[0]:.2f} % of {stood.sum()} points while it stood, "
          f"{100 * shares[1]:.2f} % of {(~stood).sum()} else")
    assert shares[0] <= shares[1] + 0.002, shares


if __name__ == "__main__":
    sys.exit(cases.run())
