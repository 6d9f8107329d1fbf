"""A flight over young pines. `--profile uav` writes obstacles and the free height below them, tree tops
alone position well enough, and impossible requests are refused."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import laspy
import numpy

sys.path.insert(0, str(Path(__file__).resolve().parent / "bad_input"))
from program import Cases, program, simulated

cases = Cases()
# Aloft at once, soon on its way and with good satellites, so that a short flight can be laid on the globe.
FLIGHT = simulated("lohja1", 5, 12, "carrier.begins_aloft=true", "carrier.still_s=1", "carrier.route_time_s=70",
                   "gnss.canopy_sd_m=0.02", "gnss.open_sd_m=0.02", "gnss.white_sd_m=0.02", "gnss.jump_interval_s=0",
                   "gnss.burst_interval_s=0")
SHORT = "sim:lohja1?seed=5&duration_s=2"
REACH_M, LOWEST_M = 15.0, 1.0


def mapped(recording, run, *more):
    done = program("map", recording, "-o", run, *more)
    assert done.returncode in (0, 4), done.stderr
    return json.loads((run / "run.json").read_text())


def points_of(file):
    cloud = laspy.read(str(file))
    return numpy.column_stack([cloud.x, cloud.y, cloud.z]), numpy.asarray(cloud["HeightAboveGround"])


def distances(points, path):
    """Of each point from the nearest place of the path, in the plane."""
    least = numpy.full(len(points), numpy.inf)
    for place in path:
        least = numpy.minimum(least, numpy.hypot(points[:, 0] - place[0], points[:, 1] - place[1]))
    return least


def cells_of(file):
    """x, y of the middle and value of each cell that has one."""
    table = subprocess.run(["gdal_translate", "-q", "-of", "XYZ", str(file), "/vsistdout/"], capture_output=True, check=True)
    cells = numpy.array([[float(cell) for cell in line.split()] for line in table.stdout.decode().splitlines()])
    return cells[cells[:, 2] > -9000.0]


def errors(run, truth):
    done = program("evaluate", run, truth, "--align", "se3", "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def trees_of_a_young_stand(run):
    """They have heights, most of them without a diameter."""
    rows = [line.split(",") for line in (run / "trees.csv").read_text().splitlines()]
    column = {name: at for at, name in enumerate(rows[0])}
    without = [row for row in rows[1:] if not row[column["dbh_m"]]]
    assert len(without) > 100 and all(float(row[column["height_m"]]) >= 1.5 for row in without), len(without)


@cases.case("obstacles stand near the path, none lower than asked, and the free height is that of the lowest")
def obstacles(folder):
    run = folder / "run"
    # In the frame of the world, so that path and layers are one.
    facts = mapped(FLIGHT, run, "--profile", "uav", "--set", "georeference.enabled=false")
    assert {"obstacles.laz", "free_height.tif"} <= set(facts["files"]), facts["files"]
    everything, heights = points_of(run / "map.laz")
    kept, kept_heights = points_of(run / "obstacles.laz")
    path = numpy.array([[float(cell) for cell in line.split()[1:3]] for line in (run / "trajectory.tum").read_text().splitlines()])
    assert kept_heights.min() >= LOWEST_M
    # A cell counts by its middle: half a diagonal either way, and the path is marked every half cell.
    assert distances(kept, path).max() < REACH_M + 0.65
    near = distances(everything[heights >= LOWEST_M], path)
    assert (near < REACH_M - 0.65).sum() <= len(kept) <= (near < REACH_M + 0.65).sum(), len(kept)
    cells = cells_of(run / "free_height.tif")
    corner = cells[:, :2].min(axis=0) - 0.25
    lowest = {}
    for cell, height in zip(map(tuple, numpy.floor((kept[:, :2] - corner) / 0.5).astype(int)), kept_heights):
        lowest[cell] = min(height, lowest.get(cell, 1e9))
    told = {tuple(numpy.floor((cell[:2] - corner) / 0.5).astype(int)): cell[2] for cell in cells}
    assert len(told) > 500
    # Points at the edge of a cell are rounded to a millimetre in the cloud.
    off = [abs(told[cell] - lowest[cell]) for cell in told if cell in lowest]
    assert len(off) > 0.98 * len(told) and numpy.median(off) < 1e-3 and numpy.mean(numpy.array(off) > 0.01) < 0.02
    trees_of_a_young_stand(run)


@cases.case("georeference moves obstacles and free height with the other layers")
def moved(folder):
    run, globe = folder / "run", folder / "globe"
    mapped(FLIGHT, run, "--profile", "uav")
    before, after = cells_of(run / "free_height.tif"), None
    done = program("georeference", run, "-o", globe, "--method", "auto", "--crs", "EPSG:32635")
    assert done.returncode in (0, 4), done.stderr
    after = cells_of(globe / "free_height.tif")
    assert abs(len(after) - len(before)) < 0.1 * len(before), (len(before), len(after))
    assert abs(numpy.median(after[:, 2]) - numpy.median(before[:, 2])) < 0.1
    many = laspy.read(str(run / "obstacles.laz")).header.point_count
    assert laspy.read(str(globe / "obstacles.laz")).header.point_count == many
    frames = json.loads((globe / "run.json").read_text())["frames"]
    assert frames["obstacles.laz"] == frames["free_height.tif"] == frames["map.laz"], frames


@cases.case("without the profile there are no obstacles")
def unasked(folder):
    facts = mapped(SHORT, folder / "run")
    assert facts["counts"]["map_points"] > 10_000, facts["counts"]
    assert not {"obstacles.laz", "free_height.tif"} & set(facts["files"])
    assert "scans_by_tree_tops" not in facts["counts"]


@cases.case("tree tops alone position within 10 cm, and all points do better")
def tops(folder):
    found = {}
    for points in ("all", "tree_tops"):
        run = folder / points
        facts = mapped(FLIGHT, run, "--set", f"preprocess.points={points}", "--set", "map.enabled=false")
        found[points] = errors(run, FLIGHT.with_suffix(".truth"))["ape_rmse_m"]
        if points == "tree_tops":
            assert facts["counts"]["scans_by_tree_tops"] > 0.9 * facts["scans"], facts["counts"]
    assert found["all"] < found["tree_tops"] < 0.10, found


@cases.case("tree tops where there are none: all points are matched, and a warning says so")
def no_tops(folder):
    done = program("map", SHORT, "-o", folder / "run", "--set", "preprocess.points=tree_tops", "--set",
                   "preprocess.tree_tops.least_points=1000000", "--set", "map.enabled=false")
    assert done.returncode in (0, 4), done.stderr
    facts = json.loads((folder / "run" / "run.json").read_text())
    assert facts["counts"]["scans_by_tree_tops"] == 0 and "tree_tops.none" in {each["key"] for each in facts["warnings"]}


@cases.case("tree tops with LOAM, and obstacles of a run by stems, are refused")
def refused(folder):
    done = program("map", FLIGHT, "-o", folder / "run", "--set", "preprocess.points=tree_tops", "--set", "registration.method=loam")
    assert done.returncode == 2 and "tree_tops does not go with" in done.stderr, done.stderr
    done = program("map", FLIGHT, "-o", folder / "run", "--front-end", "sparse", "--set", "obstacles.enabled=true")
    assert done.returncode == 2 and "obstacles" in done.stderr, done.stderr
    assert not (folder / "run").exists()


assert shutil.which("gdal_translate"), "gdal_translate is missing"
cases.run()
