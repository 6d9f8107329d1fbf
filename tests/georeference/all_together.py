"""`understory georeference --method auto` with fixes, a map of trees and a terrain model. Each degree of
freedom comes from the source that knows it, with an honest error. Sources that contradict each other are
named.

    all_together.py FIRST LAST     a table instead: errors of stands and receivers of these seeds
"""

import csv
import json
import math
import random
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program

cases = Cases()
LATITUDE, LONGITUDE, HEIGHT = 61.2, 25.1, 160.0
GEOID = 18.0                          # of the ellipsoid below the heights that the terrain model counts
TURN, TILT, SHIFT, LIFT = 2.2, math.radians(0.03), (25.0, -40.0), 3.0
DAY = 1_565_425_800
LOCAL = (f"+proj=aeqd +lat_0={LATITUDE} +lon_0={LONGITUDE} +datum=WGS84 +units=m +no_defs")
LOCAL_WKT = ('PROJCS["local",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],'
             'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Azimuthal_Equidistant"],'
             f'PARAMETER["latitude_of_center",{LATITUDE}],PARAMETER["longitude_of_center",{LONGITUDE}],'
             'PARAMETER["false_easting",0],PARAMETER["false_northing",0],UNIT["metre",1]]')


def degrees(x, y):
    """A place x east and y north of the origin, by the radii of curvature there."""
    e2 = 0.00669437999014
    s = math.sin(math.radians(LATITUDE))
    along = 6378137.0 * (1 - e2) / (1 - e2 * s * s) ** 1.5
    across = 6378137.0 / math.sqrt(1 - e2 * s * s)
    return (LATITUDE + math.degrees(y / along),
            LONGITUDE + math.degrees(x / (across * math.cos(math.radians(LATITUDE)))))


def hills(x, y):
    return 4.0 * math.sin(x / 35.0) + 3.0 * math.cos(y / 28.0) + 0.02 * x


def in_run(x, y, z):
    """The world frame of the run: turned, a little tilted about its x axis, shifted."""
    c, s = math.cos(TURN), math.sin(TURN)
    u, v, w = x - SHIFT[0], y - SHIFT[1], z - LIFT
    u, v = c * u + s * v, -s * u + c * v
    return u, math.cos(TILT) * v - math.sin(TILT) * w, math.sin(TILT) * v + math.cos(TILT) * w


def walk():
    """Two crossing loops in ten minutes, 1.5 m above the ground: (s, east, north, up)."""
    for k in range(1200):
        t = 0.5 * k
        x, y = 60 * math.sin(0.02 * t), 40 * math.sin(0.03 * t)
        yield t, x, y, hills(x, y) + 1.5


def forest(draw, side=500.0, count=8000, spacing=2.2):
    cells, trees = {}, []
    while len(trees) < count:
        x, y = draw.uniform(-side / 2, side / 2), draw.uniform(-side / 2, side / 2)
        cell = int(x // spacing), int(y // spacing)
        near = [cells.get((cell[0] + i, cell[1] + j)) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        if all(not p or math.hypot(p[0] - x, p[1] - y) >= spacing for p in near):
            cells[cell] = (x, y)
            trees.append((x, y, draw.gauss(18.0, 3.0)))
    return trees


def write_run(folder, trees, draw):
    """Half of the dominant trees near the path are in the run."""
    folder.mkdir(parents=True)
    with (folder / "trajectory.tum").open("w") as file:
        for t, *place in walk():
            file.write(f"{DAY + t:.3f} " + " ".join(f"{v:.6f}" for v in in_run(*place)) + " 0 0 0 1\n")
    near = sorted((t for t in trees if abs(t[0]) < 75 and abs(t[1]) < 55), key=lambda t: -t[2])[:200]
    rows = ["id,x,y,z,dbh_m,dbh_sd_m,height_m"]
    for k, (x, y, h) in enumerate(near):
        u, v, w = in_run(x + draw.gauss(0, 0.05), y + draw.gauss(0, 0.05), hills(x, y) + draw.gauss(0, 0.1))
        rows.append(f"{k + 1},{u:.3f},{v:.3f},{w:.3f},,,{h - 1.0:.2f}")
    (folder / "trees.csv").write_text("\n".join(rows) + "\n")
    (folder / "run.json").write_text(json.dumps(
        {"command": "map", "status": "complete", "reasons": [], "counts": {"imu_samples": 1000}}))
    return folder


def write_fixes(path, draw, sd_m=3.0, heights=True):
    """Fixes that err slowly, and state a third of it."""
    stated = (sd_m / 3) ** 2
    slow, kept = [draw.gauss(0, 1) for _ in range(3)], math.exp(-1 / 120)
    rows = ["timestamp,latitude_deg,longitude_deg,height_m,c00,c01,c02,c11,c12,c22"]
    for t, x, y, z in walk():
        if t % 1:
            continue
        slow = [kept * v + math.sqrt(1 - kept * kept) * draw.gauss(0, 1) for v in slow]
        latitude, longitude = degrees(x + sd_m * slow[0], y + sd_m * slow[1])
        height = f"{HEIGHT + z + 2 * sd_m * slow[2]:.3f}" if heights else ""
        rows.append(f"{DAY + t:.3f},{latitude:.9f},{longitude:.9f},{height},{stated},0,0,{stated},0,{4 * stated}")
    path.write_text("\n".join(rows) + "\n")
    return path


def write_map(path, trees, draw):
    """65 % of the trees with 0.7 m of noise along each axis, and 10 % that are none."""
    seen = [(x + draw.gauss(0, 0.7), y + draw.gauss(0, 0.7), h + draw.gauss(0, 1.0))
            for x, y, h in trees if draw.random() < 0.65]
    seen += [(draw.uniform(-250, 250), draw.uniform(-250, 250), 15.0) for _ in range(len(seen) // 9)]
    path.write_text("x,y,height_m\n" + "".join(f"{x:.3f},{y:.3f},{h:.2f}\n" for x, y, h in seen))
    return path


def write_terrain(path, draw, sd_m=0.3, geoid=GEOID):
    lines = ["ncols 200\nnrows 200\nxllcorner -200\nyllcorner -200\ncellsize 2\nNODATA_value -9999"]
    for row in range(200):
        y = 200 - 2 * row - 1
        lines.append(" ".join(f"{HEIGHT + geoid + hills(-200 + 2 * c + 1, y) + draw.gauss(0, sd_m):.3f}"
                              for c in range(200)))
    path.write_text("\n".join(lines) + "\n")
    path.with_suffix(".prj").write_text(LOCAL_WKT)
    return path


def placed(run, folder, *options, expected=0):
    done = program("georeference", run, "--method", "auto", "-o", folder, "--json", *options)
    assert done.returncode == expected, (done.returncode, done.stderr)
    return json.loads(done.stdout), done.stderr


def errors(folder, told, above):
    """Root mean square over the path: in the plane (m), in height (m), heading and tilt (degrees)."""
    with (folder / "trajectory.tum").open() as file:
        found = [tuple(map(float, line.split()[1:4])) for line in file]
    x0 = (told["origin_longitude_deg"] - LONGITUDE) / (degrees(1, 0)[1] - LONGITUDE)
    y0 = (told["origin_latitude_deg"] - LATITUDE) / (degrees(0, 1)[0] - LATITUDE)
    true = [(x - x0, y - y0, HEIGHT + above + z - told["origin_height_m"]) for _, x, y, z in walk()]
    n = len(true)
    plane = math.sqrt(sum((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 for a, b in zip(found, true)) / n)
    height = math.sqrt(sum((a[2] - b[2]) ** 2 for a, b in zip(found, true)) / n)
    middle = [[sum(p[k] for p in path) / n for k in range(2)] for path in (found, true)]
    cross = dot = 0.0
    for a, b in zip(found, true):
        u, v = (a[0] - middle[0][0], a[1] - middle[0][1]), (b[0] - middle[1][0], b[1] - middle[1][1])
        cross += v[0] * u[1] - v[1] * u[0]
        dot += u[0] * v[0] + u[1] * v[1]
    return plane, height, math.degrees(math.atan2(cross, dot))


def make_inputs(seed, folder):
    """A run, its fixes, a map of trees and a terrain model."""
    draw = random.Random(seed)
    trees = forest(draw)
    return (write_run(folder / "run", trees, draw), write_fixes(folder / "walk.csv", draw),
            write_map(folder / "stand.csv", trees, draw), write_terrain(folder / "terrain.asc", draw))


def table(seeds):
    """Errors over the path and what was expected, seed by seed, and their root mean squares."""
    rows = []
    for seed in seeds:
        folder = cases.folder / str(seed)
        folder.mkdir()
        run, fixes, tree_map, terrain = make_inputs(seed, folder)
        told, _ = placed(run, folder / "placed", "--gnss", fixes, "--tree-map", tree_map, "--tree-map-crs", LOCAL,
                         "--dem", terrain)
        plane, height, heading = errors(folder / "placed", told, GEOID)
        rows.append((math.hypot(plane, height), told["expected_error_m"], height, heading))
        print(f"{seed}: {rows[-1][0]:.3f} m, expected {rows[-1][1]:.3f} m; height {height:.3f} m, heading "
              f"{heading:.3f} degrees; {told['method']}", flush=True)
    means = [math.sqrt(sum(row[k] ** 2 for row in rows) / len(rows)) for k in range(4)]
    print(f"root mean squares of {len(rows)}: {means[0]:.3f} m, expected {means[1]:.3f} m; height {means[2]:.3f} m, "
          f"heading {means[3]:.3f} degrees; worst {max(row[0] for row in rows):.3f} m")


if len(sys.argv) == 3:
    table(range(int(sys.argv[1]), int(sys.argv[2]) + 1))
    sys.exit()

RUN, FIXES, MAP, DEM = make_inputs(4, cases.folder)
TREE_OPTIONS = ("--tree-map", MAP, "--tree-map-crs", LOCAL)


@cases.case("fixes, trees and terrain model")
def all_of_them(folder):
    told, _ = placed(RUN, folder / "placed", "--gnss", FIXES, *TREE_OPTIONS, "--dem", DEM)
    plane, height, heading = errors(folder / "placed", told, GEOID)
    assert told["method"] == "split+trees+terrain", told["method"]
    assert math.hypot(plane, height) < 0.25 and abs(heading) < 0.25, (plane, height, heading)
    assert 0.5 < told["expected_error_m"] / math.hypot(plane, height) < 6, (told["expected_error_m"], plane, height)
    run = json.loads((folder / "placed" / "run.json").read_text())
    assert run["status"] == "complete", run["reasons"]
    assert "terrain model" in json.dumps(run), "whose heights they are"
    return f"{plane:.2f} m in the plane, {height:.2f} m in height, {heading:.2f} degrees; " \
           f"expected {told['expected_error_m']:.2f} m"


@cases.case("each alone is worse")
def one_by_one(folder):
    told, _ = placed(RUN, folder / "fixes", "--gnss", FIXES)
    alone = errors(folder / "fixes", told, 0.0)
    with_trees, _ = placed(RUN, folder / "trees", "--gnss", FIXES, *TREE_OPTIONS)
    trees = errors(folder / "trees", with_trees, 0.0)
    with_terrain, said = placed(RUN, folder / "terrain", "--gnss", FIXES, "--dem", DEM)
    terrain = errors(folder / "terrain", with_terrain, GEOID)
    assert trees[0] < 0.25 < alone[0], (trees, alone)
    assert terrain[1] < 0.3 * alone[1], (terrain, alone)
    assert with_trees["expected_error_m"] < told["expected_error_m"]
    assert with_terrain["expected_error_m"] < told["expected_error_m"]
    assert "its heights are" in said and abs(with_terrain["terrain_above_fixes_m"] - GEOID) < 6, said
    return f"plane {alone[0]:.2f} m, with trees {trees[0]:.2f} m; height {alone[1]:.2f} m, with terrain {terrain[1]:.2f} m"


@cases.case("trees and terrain model, no fix")
def without_fixes(folder):
    told, _ = placed(RUN, folder / "placed", *TREE_OPTIONS, "--near", "10", "-20", "--dem", DEM)
    plane, height, heading = errors(folder / "placed", told, GEOID)
    assert told["method"] == "trees+terrain" and math.hypot(plane, height) < 0.25 and abs(heading) < 0.25, \
        (plane, height, heading)
    return f"{plane:.2f} m in the plane, {height:.2f} m in height"


@cases.case("fixes without heights, terrain model")
def flat_fixes(folder):
    flat = write_fixes(folder / "flat.csv", random.Random(9), heights=False)
    told, said = placed(RUN, folder / "placed", "--gnss", flat, "--dem", DEM)
    _, height, _ = errors(folder / "placed", told, GEOID)
    assert height < 0.3, height
    assert "its heights are" not in said, said
    return f"{height:.2f} m in height"


@cases.case("a terrain model whose heights are no heights in metres")
def in_feet(folder):
    feet = folder / "feet.asc"
    head, rows = DEM.read_text().splitlines()[:6], DEM.read_text().splitlines()[6:]
    lines = [" ".join(f"{float(value) / 0.3048:.3f}" for value in row.split()) for row in rows]
    feet.write_text("\n".join(head + lines) + "\n")
    feet.with_suffix(".prj").write_text(LOCAL_WKT)
    told, _ = placed(RUN, folder / "placed", "--gnss", FIXES, "--dem", feet, expected=4)
    assert any("No height system" in reason for reason in told["reasons"]), told["reasons"]
    return told["reasons"][0][-90:]


@cases.case("a terrain model that agrees with the fixes' heights")
def same_heights(folder):
    level = write_terrain(folder / "level.asc", random.Random(6), geoid=0.0)
    _, said = placed(RUN, folder / "placed", "--gnss", FIXES, "--dem", level)
    assert "its heights are" not in said, said
    return "no warning"


@cases.case("a tree map of another forest")
def other_forest(folder):
    other = write_map(folder / "other.csv", forest(random.Random(77)), random.Random(5))
    told, said = placed(RUN, folder / "placed", "--gnss", FIXES, "--tree-map", other, "--tree-map-crs", LOCAL)
    assert told["method"] == "split" and "the trees were not found in it" in said, said
    return "left out, and said"


@cases.case("a tree map that lies 12 m off")
def contradiction(folder):
    """Fixes as precise as a survey, and trees that fit as well elsewhere."""
    moved = folder / "moved.csv"
    rows = list(csv.reader(MAP.open()))
    moved.write_text("\n".join([",".join(rows[0])] + [f"{float(r[0]) + 12.0:.3f},{r[1]},{r[2]}" for r in rows[1:]]) + "\n")
    precise = write_fixes(folder / "precise.csv", random.Random(8), sd_m=0.05)
    told, said = placed(RUN, folder / "placed", "--gnss", precise, "--tree-map", moved, "--tree-map-crs", LOCAL,
                        expected=4)
    assert any("contradict" in reason for reason in told["reasons"]), told["reasons"]
    return told["reasons"][0][:70]


@cases.case("what is missing is named")
def missing(folder):
    for code, word, options in ((3, "expected fixes or --tree-map", ("--dem", DEM)),
                                (2, "need --tree-map", ("--near", "1", "2")),
                                (3, "coordinate system", ("--gnss", FIXES, "--tree-map", MAP)),
                                (3, "no such file", ("--gnss", FIXES, "--tree-map", folder / "none.csv"))):
        done = program("georeference", RUN, "--method", "auto", "-o", folder / "placed", *options)
        assert done.returncode == code and word in done.stderr, (code, word, done.returncode, done.stderr)
        assert not (folder / "placed" / "trajectory.tum").exists()
    return "four messages"


cases.run()
