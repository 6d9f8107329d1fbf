"""`understory georeference`: a run is laid on a GNSS path whose receiver runs away, and levelled to a
terrain model in a national grid. Input that will not do is refused."""

import csv
import json
import math
import random
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program

cases = Cases()
LATITUDE, LONGITUDE, HEIGHT = 63.318, 30.193, 160.0  # true origin
TURN, SHIFT = 1.9, (25.0, -40.0)                     # of the run's frame against east and north
TILT = 0.012                                         # of the run against gravity, about its x axis


def hills(x, y):
    """Above the true origin, x east, y north."""
    return 3.0 * math.sin(x / 30.0) + 2.0 * math.cos(y / 20.0) + 0.02 * x


def degrees(x, y):
    """A place x east and y north of the origin, by the radii of curvature there."""
    e2 = 0.00669437999014
    s = math.sin(math.radians(LATITUDE))
    along = 6378137.0 * (1 - e2) / (1 - e2 * s * s) ** 1.5 + HEIGHT
    across = 6378137.0 / math.sqrt(1 - e2 * s * s) + HEIGHT
    return (LATITUDE + math.degrees(y / along),
            LONGITUDE + math.degrees(x / (across * math.cos(math.radians(LATITUDE)))))


def in_run(x, y, z):
    """From the truth to the run's frame: turned, shifted, tilted, 155 m lower."""
    c, s = math.cos(TURN), math.sin(TURN)
    u, v = c * (x - SHIFT[0]) + s * (y - SHIFT[1]), -s * (x - SHIFT[0]) + c * (y - SHIFT[1])
    return u, v * math.cos(TILT) - z * math.sin(TILT), v * math.sin(TILT) + z * math.cos(TILT)


def drive():
    """Along a bent road of 170 m at 0.25 m/s, scanner 3 m above the ground: (t, x, y, z)."""
    for k in range(1360):
        t = 0.5 * k
        s = 0.125 * k
        x, y = s - 85.0, 14.0 * math.sin(s / 45.0) + 0.0015 * s * s
        yield t, x, y, hills(x, y) + 3.0


def errors_of(draw, runaways=True):
    slow = [0.0, 0.0]
    for k, pose in enumerate(drive()):
        slow = [0.99 * v + 0.08 * draw.gauss(0, 1) for v in slow]
        away = 5.0 if runaways and (200 < k < 300 or 700 < k < 820 or 1100 < k < 1160) else 0.0
        yield pose, slow[0] - 0.3 * away, slow[1] + away


def write_status(folder):
    (folder / "run.json").write_text('{"command": "map", "status": "complete", "reasons": []}')


def write_run(folder, timed=True):
    folder.mkdir(parents=True)
    with (folder / "trajectory.tum").open("w") as file:
        for t, x, y, z in drive():
            u, v, w = in_run(x, y, z)
            file.write(f"{t if timed else t + 5e5:.3f} {u:.6f} {v:.6f} {w:.6f} 0 0 0 1\n")
    draw = random.Random(3)
    rows = ["id,x,y,z,dbh_m,dbh_sd_m,height_m,lean_deg,observations,x_sd_m,y_sd_m"]
    true = []
    for k in range(700):
        x, y = draw.uniform(-100, 100), draw.uniform(-35, 60)
        # Every eighth foot is hidden: it looks too high.
        z = hills(x, y) + draw.gauss(0, 0.08) + (0.7 if k % 8 == 0 else 0.0)
        u, v, w = in_run(x, y, z)
        true.append((x, y))
        rows.append(f"{k + 1},{u:.4f},{v:.4f},{w:.4f},0.21,0.01,,2.5,14,0.02,0.01")
    (folder / "trees.csv").write_text("\n".join(rows) + "\n")
    write_status(folder)
    (folder / "felled.csv").write_text("id,x,y,seen_until,gone_since,missed\n"
                                       "5,0,0,1500000100.000000001,1500000130.000000000,12\n")
    return folder, true


def write_fixes(path, **more):
    rows = ["timestamp,latitude_deg,longitude_deg,height_m"]
    for k, ((t, x, y, z), east, north) in enumerate(errors_of(random.Random(11), **more)):
        if k % 2 == 0:
            latitude, longitude = degrees(x + east, y + north)
            rows.append(f"{t:.3f},{latitude:.9f},{longitude:.9f},{HEIGHT + z:.3f}")
    path.write_text("\n".join(rows) + "\n")
    return path


def grid_east_north(x, y):
    """ETRS-TM35FIN of a place near the origin, by Krueger's series to the third order."""
    latitude, longitude = (math.radians(v) for v in degrees(x, y))
    f = 1 / 298.257222101
    n = f / (2 - f)
    big_a = 6378137.0 / (1 + n) * (1 + n * n / 4 + n ** 4 / 64)
    a = [n / 2 - 2 / 3 * n * n + 5 / 16 * n ** 3, 13 / 48 * n * n - 3 / 5 * n ** 3, 61 / 240 * n ** 3]
    k = 2 * math.sqrt(n) / (1 + n)
    t = math.sinh(math.atanh(math.sin(latitude)) - k * math.atanh(k * math.sin(latitude)))
    d = longitude - math.radians(27)
    xi, eta = math.atan2(t, math.cos(d)), math.atanh(math.sin(d) / math.hypot(1, t))
    east = 500000 + 0.9996 * big_a * (eta + sum(
        a[j] * math.cos(2 * (j + 1) * xi) * math.sinh(2 * (j + 1) * eta) for j in range(3)))
    north = 0.9996 * big_a * (xi + sum(
        a[j] * math.sin(2 * (j + 1) * xi) * math.cosh(2 * (j + 1) * eta) for j in range(3)))
    return east, north


TM35FIN = ('PROJCS["TM35FIN",GEOGCS["ETRS89",DATUM["European_Terrestrial_Reference_System_1989",'
           'SPHEROID["GRS 1980",6378137,298.257222101]],PRIMEM["Greenwich",0],'
           'UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],'
           'PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",27],'
           'PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],'
           'PARAMETER["false_northing",0],UNIT["metre",1]]')


def write_terrain(path, national=True, sd_m=0.15, above=lambda x, y: 0.0):
    """The hills in cells of 2 m with the noise that P1 gives for its model, and what stands above them."""
    east0, north0 = grid_east_north(0, 0) if national else (0.0, 0.0)
    c = s = 1.0
    if national:  # the local turn and scale of the grid, from the series itself
        e, n = grid_east_north(0, 100)
        s, c = (e - east0) / 100, (n - north0) / 100
    else:
        s, c = 0.0, 1.0
    scale2 = s * s + c * c
    draw = random.Random(5)
    lines = [f"ncols 160\nnrows 160\nxllcorner {east0 - 160:.4f}\nyllcorner {north0 - 160:.4f}\n"
             "cellsize 2\nNODATA_value -9999"]
    for row in range(160):
        n = 160 - 2 * row - 1
        heights = []
        for column in range(160):
            e = -160 + 2 * column + 1
            x, y = (c * e - s * n) / scale2, (s * e + c * n) / scale2
            heights.append(f"{HEIGHT - 18.0 + hills(x, y) + above(x, y) + draw.gauss(0, sd_m):.3f}"
                           if abs(x) < 155 else "-9999")
        lines.append(" ".join(heights))
    path.write_text("\n".join(lines) + "\n")
    if national:
        path.with_suffix(".prj").write_text(TM35FIN)
    return path


def places(path, separator=","):
    if path.suffix == ".tum":
        return [tuple(map(float, line.split()[1:4])) for line in path.read_text().splitlines()]
    with path.open() as file:
        return [tuple(float(row[key]) for key in "xyz") for row in csv.DictReader(file)]


def first_fix(fixes):
    with fixes.open() as file:
        row = next(csv.DictReader(file))
    latitude, longitude = float(row["latitude_deg"]), float(row["longitude_deg"])
    origin, east = degrees(0, 0), degrees(1, 0)
    north = degrees(0, 1)
    return ((longitude - origin[1]) / (east[1] - origin[1]),
            (latitude - origin[0]) / (north[0] - origin[0]))


def plane_error(trajectory, fixes):
    """Of a path in the frame of the first fix: mean offset and root mean square about it."""
    x0, y0 = first_fix(fixes)
    d = [(p[0] + x0 - x, p[1] + y0 - y) for p, (_, x, y, _) in zip(places(trajectory), drive())]
    mean = [sum(v) / len(d) for v in zip(*d)]
    spread = math.sqrt(sum((u - mean[0]) ** 2 + (v - mean[1]) ** 2 for u, v in d) / len(d))
    return math.hypot(*mean), spread


def georeference(*arguments):
    return program("georeference", *arguments)


RUN, TRUE = write_run(cases.folder / "run")
FIXES = write_fixes(cases.folder / "fixes.csv")
DEM = write_terrain(cases.folder / "national.asc")
LOCAL = write_terrain(cases.folder / "local.asc", national=False)
PLACED = cases.folder / "placed"
FIRST = georeference(RUN, "--method", "gnss-path", "--gnss", FIXES, "-o", PLACED, "--json")


@cases.case("a path laid on that of a receiver which runs away three times")
def robust(folder):
    assert FIRST.returncode == 0, FIRST.stderr
    told = json.loads(FIRST.stdout)
    offset, spread = plane_error(PLACED / "trajectory.tum", FIXES)
    assert offset < 1.3 and spread < 0.4, (offset, spread)
    assert told["gnss_fixes_median_m"] < 1.2 and 0.7 < told["gnss_fixes_used_share"] < 0.95, told
    # By time the fixes that ran away count in full.
    assert 1.0 < told["gnss_across_rms_m"] < 3.5 and told["gnss_along_rms_m"] < 2.5, told
    plain = georeference(RUN, "--method", "gnss-path", "--gnss", FIXES, "-o", folder / "plain",
                         "--plain", "--json")
    assert plain.returncode == 0, plain.stderr
    as_printed = json.loads(plain.stdout)
    assert as_printed["gnss_fit_rms_m"] < told["gnss_fit_rms_m"], (as_printed, told)
    worse, _ = plane_error(folder / "plain" / "trajectory.tum", FIXES)
    assert worse > offset + 0.2, (worse, offset)
    run = json.loads((PLACED / "run.json").read_text())
    assert run["command"] == "georeference" and run["status"] == "complete", run
    assert abs(run["quality"]["origin_latitude_deg"] - LATITUDE) < 1e-3, run["quality"]
    page = (PLACED / "report.html").read_text()
    drawn = page[page.index('class="fixes"'):].split("</g>")[0].count("<circle")
    assert 500 < drawn <= 2000 and 'opacity="0.35"' in page, drawn
    rows = list(csv.DictReader((PLACED / "gnss.csv").open()))
    assert len(rows) == 680 and {row["used"] for row in rows} == {"0", "1"}
    assert (PLACED / "trees.gpkg").stat().st_size > 10000
    trees = list(csv.DictReader((PLACED / "trees.csv").open()))
    assert len(trees) == 700 and trees[0]["observations"] == "14" and trees[0]["lean_deg"] == "2.50"
    fall = next(csv.DictReader((PLACED / "felled.csv").open()))
    tree = next(row for row in trees if row["id"] == "5")
    assert (fall["x"], fall["y"]) == (tree["x"], tree["y"]) and fall["x"] != "0.000", (fall, tree)
    assert fall["seen_until"] == "1500000100.000000001" and fall["missed"] == "12", fall
    assert run["counts"]["trees_felled"] == 1 and 'class="falls"' in page, run["counts"]
    return f"{offset:.2f} m off, bent by {spread:.2f} m; as printed {worse:.2f} m off"


@cases.case("the same from an NMEA log, and without a common clock")
def nmea(folder):
    def sentence(body):
        check = 0
        for letter in body.encode():
            check ^= letter
        return f"${body}*{check:02X}\r\n"

    def angle(value, digits, letters):
        whole = int(abs(value))
        return f"{whole:0{digits}d}{60 * (abs(value) - whole):08.5f},{letters[value < 0]}"

    text = ""
    for k, ((t, x, y, z), east, north) in enumerate(errors_of(random.Random(11))):
        if k % 2 == 0:
            latitude, longitude = degrees(x + east, y + north)
            clock = f"{10 + int(t) // 3600:02d}{int(t) // 60 % 60:02d}{t % 60:05.2f}"
            text += sentence(f"GPRMC,{clock},A,{angle(latitude, 2, 'NS')},{angle(longitude, 3, 'EW')}"
                             ",0.2,0.0,150817,,,A")
    log = folder / "drive.nmea"
    log.write_text(text)
    done = georeference(RUN, "--method", "gnss-path", "--gnss", log, "-o", folder / "placed",
                        "--json")
    assert done.returncode == 0, done.stderr
    told, first = json.loads(done.stdout), json.loads(FIRST.stdout)
    assert "gnss_along_rms_m" not in told, told
    assert abs(told["gnss_fit_rms_m"] - first["gnss_fit_rms_m"]) < 0.01, (told, first)
    assert abs(told["gnss_yaw_deg"] - first["gnss_yaw_deg"]) < 0.05, (told, first)


@cases.case("threads make no difference")
def threads(folder):
    done = georeference(RUN, "--method", "gnss-path", "--gnss", FIXES, "-o", folder / "one",
                        "--threads", 1)
    assert done.returncode == 0, done.stderr
    for name in ("trajectory.tum", "trees.csv", "gnss.csv", "trees.gpkg"):
        assert (folder / "one" / name).read_bytes() == (PLACED / name).read_bytes(), name


def height_errors(folder):
    """Of the path above the true ground: (mean, root mean square about it)."""
    d = [p[2] - z for p, (_, _, _, z) in zip(places(folder / "trajectory.tum"), drive())]
    mean = sum(d) / len(d)
    return mean, math.sqrt(sum((v - mean) ** 2 for v in d) / len(d))


@cases.case("levelled to a model in the national grid")
def levelled(folder):
    done = georeference(PLACED, "--method", "terrain", "--dem", DEM, "-o", folder / "level", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert abs(told["terrain_tilt_deg"] - math.degrees(TILT)) < 0.1, told
    assert told["terrain_points_used"] > 550 and told["terrain_median_m"] < 0.25, told
    _, before = height_errors(PLACED)
    mean, after = height_errors(folder / "level")
    # The model's heights are 18 m below those of the ellipsoid; the frame's origin is the first fix.
    origin = json.loads((folder / "level" / "run.json").read_text())["quality"]["origin_height_m"]
    assert abs(mean + origin - (HEIGHT - 18.0)) < 0.15, (mean, origin)
    assert after < 0.1 and 4 * after < before, (before, after)
    # Place and heading stay, and so does how sure they are.
    placed, level = (json.loads((run / "run.json").read_text())["georeference"] for run in (PLACED, folder / "level"))
    assert placed["heading_sd_deg"] > 0 and level["heading_sd_deg"] == placed["heading_sd_deg"], (placed, level)
    assert level["expected_error_m"] == placed["expected_error_m"], (placed, level)
    assert told["sd_heading_deg"] == placed["heading_sd_deg"], told
    done = georeference(PLACED, "--method", "terrain", "--dem", DEM, "-o", folder / "moved", "--json", "--yaw-sd-deg", 3)
    moved = json.loads((folder / "moved" / "run.json").read_text())["georeference"]
    assert done.returncode == 0 and moved["heading_sd_deg"] is None, (done.stderr, moved)
    return f"height of the path {100 * before:.0f} -> {100 * after:.0f} cm"


@cases.case("a surface model is no terrain model, and a constant is none of its errors")
def surface(folder):
    def crown(x, y):
        cell = math.sin(12.9898 * math.floor(x / 4) + 78.233 * math.floor(y / 4)) * 43758.5453 % 1.0
        return 6.0 + 9.0 * cell if cell > 0.35 else 0.0

    told = {}
    for name, above, code in (("higher", lambda x, y: 19.5, 0), ("surface", crown, 4)):
        model = write_terrain(folder / f"{name}.asc", above=above)
        done = georeference(PLACED, "--method", "terrain", "--dem", model, "-o", folder / name, "--json")
        assert done.returncode == code, done
        told[name] = json.loads(done.stdout)["terrain_median_m"]
    run = json.loads((folder / "surface" / "run.json").read_text())
    assert run["status"] == "untrusted", run
    assert any("surface or canopy model" in reason for reason in run["reasons"]), run["reasons"]
    return f"{told['higher']:.2f} m beside {told['surface']:.2f} m in the median"


@cases.case("levelled to a model of the place itself, from a known start")
def started(folder):
    start = ("--start", *SHIFT, math.degrees(TURN))
    done = georeference(RUN, "--method", "terrain", "--dem", LOCAL, "-o", folder / "level", "--json",
                        *start)
    assert done.returncode == 0, done.stderr
    _, after = height_errors(folder / "level")
    assert after < 0.12, after
    # A start that is 3 m off: the relief brings it back if it may.
    wrong = ("--start", SHIFT[0] + 2.5, SHIFT[1] - 2.0, math.degrees(TURN) + 1.5)
    ends = {}
    for name, more in (("kept", ()), ("moved", ("--place-sd-m", 4, "--yaw-sd-deg", 3))):
        done = georeference(RUN, "--method", "terrain", "--dem", LOCAL, "-o", folder / name, "--json",
                            *wrong, *more)
        assert done.returncode == 0, done.stderr
        ends[name] = math.sqrt(sum((p[0] - x) ** 2 + (p[1] - y) ** 2 for p, (_, x, y, _) in zip(
            places(folder / name / "trajectory.tum"), drive())) / 1360)
    assert ends["moved"] < 0.6 < 2.5 < ends["kept"], ends
    return f"place {ends['kept']:.1f} -> {ends['moved']:.1f} m"


@cases.case("a way that is straight fits both ways round, and the clock tells which")
def straight(folder):
    run = folder / "run"
    run.mkdir()
    lines = [f"{0.5 * k:.2f} {0.125 * k:.4f} 0 0 0 0 0 1" for k in range(1000)]
    (run / "trajectory.tum").write_text("\n".join(lines) + "\n")
    write_status(run)
    rows = ["timestamp,latitude_deg,longitude_deg,height_m"]
    for k in range(0, 1000, 2):
        latitude, longitude = degrees(-0.125 * k, 0.4 * math.sin(k))
        rows.append(f"{0.5 * k:.2f},{latitude:.9f},{longitude:.9f},160")
    fixes = folder / "fixes.csv"
    fixes.write_text("\n".join(rows) + "\n")
    done = georeference(run, "--method", "gnss-path", "--gnss", fixes, "-o", folder / "a", "--json")
    assert done.returncode == 0, done.stderr
    assert abs(abs(json.loads(done.stdout)["gnss_yaw_deg"]) - 180) < 1, done.stdout
    fixes.write_text("\n".join([rows[0]] + [f"{5e5 + k},{row.split(',', 1)[1]}"
                                            for k, row in enumerate(rows[1:])]) + "\n")
    done = georeference(run, "--method", "gnss-path", "--gnss", fixes, "-o", folder / "b")
    assert done.returncode == 4 and "the other way round" in done.stderr, done


def heading_of(folder, name, way, noise_m, turn=0.6):
    """A way (x, y) in the run's frame and fixes that err slowly: what was said, and how far it is off."""
    run = folder / name
    run.mkdir()
    draw = random.Random(name)
    c, s = math.cos(turn), math.sin(turn)
    lines, rows, slow = [], ["timestamp,latitude_deg,longitude_deg,height_m"], [0.0, 0.0]
    for k, (x, y) in enumerate(way):
        slow = [0.95 * v + math.sqrt(1 - 0.95**2) * noise_m * draw.gauss(0, 1) for v in slow]
        latitude, longitude = degrees(c * x - s * y + slow[0], s * x + c * y + slow[1])
        lines.append(f"{k}.0 {x:.4f} {y:.4f} 0 0 0 0 1")
        rows.append(f"{k}.0,{latitude:.9f},{longitude:.9f},160")
    (run / "trajectory.tum").write_text("\n".join(lines) + "\n")
    write_status(run)
    (run / "fixes.csv").write_text("\n".join(rows) + "\n")
    done = georeference(run, "--method", "gnss-path", "--gnss", run / "fixes.csv", "-o",
                        folder / f"{name}_placed", "--json")
    told = json.loads(done.stdout)
    off = abs((told["gnss_yaw_deg"] - math.degrees(turn) + 180) % 360 - 180)
    return done, told["gnss_heading_sd_deg"], off


@cases.case("a way whose fixes cannot tell the heading is not called placed")
def heading(folder):
    told = []
    short = [(0.02 * k, 0.6 * math.sin(0.02 * k)) for k in range(400)]
    stays = [(8.0 * min(1.0, k / 40), 0.4 * math.sin(0.1 * k)) for k in range(400)]
    circle = [(15 * math.cos(0.0157 * k), 15 * math.sin(0.0157 * k)) for k in range(400)]
    for name, way in (("short", short), ("stays", stays), ("circle", circle)):
        done, sd, off = heading_of(folder, name, way, 3.0)
        assert done.returncode == 4 and "the heading is uncertain" in done.stderr, (name, done)
        assert sd > 5 and f"{sd:.1f} degrees" in done.stderr, (name, sd, done.stderr)
        run = json.loads((folder / f"{name}_placed" / "run.json").read_text())
        assert run["status"] == "untrusted", run["status"]
        told.append(f"{name} {off:.0f} of {sd:.0f}")
    corner = [(0.4 * min(k, 250), 0.4 * max(0, k - 250)) for k in range(400)]
    straight = [(0.3 * k, 0.5 * math.sin(0.05 * k)) for k in range(400)]
    for name, way in (("corner", corner), ("straight", straight)):
        done, sd, off = heading_of(folder, name, way, 1.5)
        assert done.returncode == 0 and sd < 5, (name, done, sd)
        assert off < 4 * sd + 0.1, (name, off, sd)
        told.append(f"{name} {off:.1f} of {sd:.1f}")
    return "; ".join(told) + " degrees off of those expected"


@cases.case("an antenna that is tens of metres away")
def antenna(folder):
    done = georeference(RUN, "--method", "gnss-path", "--gnss", FIXES, "-o", folder / "far",
                        "--antenna-m", 40, 0, 2)
    assert "check that these are metres" in done.stderr, done


@cases.case("wrong use and bad input")
def bad(folder):
    def refused(code, word, *arguments):
        out = cases.folder / "refused"
        done = georeference(*arguments, "-o", out)
        assert done.returncode == code and word in done.stderr, (arguments, done)
        assert not out.exists(), arguments

    refused(2, "--method", RUN)
    refused(2, "--dem", RUN, "--method", "terrain")
    refused(2, "--start belongs", RUN, "--method", "gnss-path", "--start", 1, 2, 3)
    refused(2, "--plain does not belong", RUN, "--method", "terrain", "--dem", DEM, "--plain")
    refused(3, "gnss.csv", RUN, "--method", "gnss-path")
    refused(3, "no such file", RUN, "--method", "gnss-path", "--gnss", folder / "none.csv")
    (folder / "empty.csv").write_text("timestamp,latitude_deg,longitude_deg\n")
    refused(3, "none there", RUN, "--method", "gnss-path", "--gnss", folder / "empty.csv")
    (folder / "words.csv").write_text("timestamp,latitude_deg,longitude_deg\n1,north,2\n")
    refused(3, "words.csv", RUN, "--method", "gnss-path", "--gnss", folder / "words.csv")
    refused(3, "trajectory.tum", folder, "--method", "gnss-path", "--gnss", FIXES)
    refused(2, "coordinate system", RUN, "--method", "gnss-path", "--gnss", FIXES, "--crs", "EPSG:1")
    # A national model under a run that does not know where on the earth it is.
    refused(3, "--start", RUN, "--method", "terrain", "--dem", DEM)
    # A model around zero lies under it by chance: nothing says that it lies there.
    refused(3, "--start", RUN, "--method", "terrain", "--dem", LOCAL)
    refused(3, "of the place", RUN, "--method", "terrain", "--dem", DEM, "--start", 0, 0, 0)
    refused(2, "no finite number", RUN, "--method", "terrain", "--dem", LOCAL, "--start", 0, 0, "nan")
    refused(2, "no finite number", RUN, "--method", "gnss-path", "--gnss", FIXES, "--antenna-m", 0,
            "inf", 0)
    (folder / "cut.asc").write_text("ncols 160\nnrows 160\nxllcorner -160\nyllcorner -160\n"
                                    "cellsize 2\n1 2 3\n")
    refused(3, "cut.asc", RUN, "--method", "terrain", "--dem", folder / "cut.asc", "--start", 0, 0, 0)
    done = georeference(PLACED, "--method", "terrain", "--dem", DEM, "-o", PLACED)
    assert done.returncode == 3 and "is the input" in done.stderr, done
    (folder / "file").write_text("")
    done = georeference(RUN, "--method", "gnss-path", "--gnss", FIXES, "-o", folder / "file" / "x")
    assert done.returncode == 3, done


cases.run()
