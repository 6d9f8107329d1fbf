"""`understory georeference` by the times of satellite positions and by control points. Every method lays
a run where it belongs within its stated error, and names what is wrong with bad input."""

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
TURN, SHIFT, LIFT = 2.2, (25.0, -40.0), 3.0  # of the run's frame against east and north
DAY = 1_565_425_800                          # 2019-08-10 08:30:00 UTC


def degrees(x, y):
    """A place x east and y north of the origin, by the radii of curvature there."""
    e2 = 0.00669437999014
    s = math.sin(math.radians(LATITUDE))
    along = 6378137.0 * (1 - e2) / (1 - e2 * s * s) ** 1.5 + HEIGHT
    across = 6378137.0 / math.sqrt(1 - e2 * s * s) + HEIGHT
    return (LATITUDE + math.degrees(y / along),
            LONGITUDE + math.degrees(x / (across * math.cos(math.radians(LATITUDE)))))


def walk(until_s=600.0):
    """Two crossing loops in ten minutes: (s, east, north, up)."""
    for k in range(1200):
        t = 0.5 * k
        if t >= until_s:
            return
        yield t, 60 * math.sin(0.02 * t), 40 * math.sin(0.03 * t), 2 * math.sin(0.05 * t)


def in_run(x, y, z):
    c, s = math.cos(TURN), math.sin(TURN)
    u, v = x - SHIFT[0], y - SHIFT[1]
    return c * u + s * v, -s * u + c * v, z - LIFT


def write_run(folder, level=True, last_s=600.0):
    folder.mkdir(parents=True)
    with (folder / "trajectory.tum").open("w") as file:
        for t, *place in walk(last_s):
            file.write(f"{DAY + t:.3f} " + " ".join(f"{v:.6f}" for v in in_run(*place)) + " 0 0 0 1\n")
    counts = {"imu_samples": 1000} if level else {}
    (folder / "run.json").write_text(json.dumps(
        {"command": "map", "status": "complete", "reasons": [], "counts": counts}))
    return folder


def received(sd_m=1.5, seed=3, height_factor=3.0, until_s=600.0):
    """Fixes that err slowly: (s, latitude, longitude, height)."""
    draw = random.Random(seed)
    slow = [draw.gauss(0, 1) for _ in range(3)]
    kept = math.exp(-1 / 60)
    for t, x, y, z in walk(until_s):
        if t % 1:
            continue
        slow = [kept * v + math.sqrt(1 - kept**2) * draw.gauss(0, 1) for v in slow]
        e, n, u = (sd_m * (v + 0.1 * draw.gauss(0, 1)) for v in slow)
        yield (t, *degrees(x + e, y + n), HEIGHT + z + height_factor * u)


def write_fixes(path, fixes, late_s=0.0):
    rows = ["timestamp,latitude_deg,longitude_deg,height_m"]
    rows += [f"{DAY + t + late_s:.3f},{la:.10f},{lo:.10f},{h:.4f}" for t, la, lo, h in fixes]
    path.write_text("\n".join(rows) + "\n")
    return path


RUN = write_run(cases.folder / "run")
FIXES = write_fixes(cases.folder / "fixes.csv", received())


def georeference(*arguments):
    return program("georeference", *arguments)


def error_of(folder):
    """Root mean square over the path, in east, north, up of the true origin."""
    told = json.loads((folder / "run.json").read_text())["quality"]
    la, lo = told["origin_latitude_deg"], told["origin_longitude_deg"]
    origin, one = degrees(0, 0), degrees(1, 1)
    x0, y0 = (lo - origin[1]) / (one[1] - origin[1]), (la - origin[0]) / (one[0] - origin[0])
    z0 = told["origin_height_m"] - HEIGHT
    squares, turn = 0.0, []
    rows = [list(map(float, line.split())) for line in (folder / "trajectory.tum").read_text().splitlines()]
    for row, (_, x, y, z) in zip(rows, walk()):
        squares += (row[1] + x0 - x) ** 2 + (row[2] + y0 - y) ** 2 + (row[3] + z0 - z) ** 2
    return math.sqrt(squares / len(rows))


# fit3 expects a smaller error than split, but leaves the tilt open: `map` laid no short walk on the globe.
@cases.case("a short path takes its tilt from the run")
def short_path(folder):
    run = write_run(folder / "run", last_s=14.0)
    fixes = write_fixes(folder / "fixes.csv", received(0.2, height_factor=1.0, until_s=14.0))
    told = {}
    for method in ("fit3", "split", "auto"):
        done = georeference(run, "--method", method, "--gnss", fixes, "-o", folder / method, "--json")
        told[method] = json.loads(done.stdout)
        tilt = max(told[method]["sd_turn_east_deg"], told[method]["sd_turn_north_deg"])
        told[method]["tilt"] = tilt
        assert ("the tilt is uncertain" in done.stderr) == (tilt > 5), (method, done.stderr)
    assert told["fit3"]["tilt"] > 5 > told["split"]["tilt"], told
    assert told["fit3"]["expected_error_m"] < told["split"]["expected_error_m"], told
    assert told["auto"]["method"] == "split", told["auto"]
    text = georeference(run, "--method", "auto", "--gnss", fixes, "-o", folder / "again").stdout
    assert "degrees of tilt" in text, text
    return text.splitlines()[0]


@cases.case("every method lies within what it promises, and auto takes the best and says why")
def methods(folder):
    told = {}
    for method in ("closed", "fit3", "split", "auto"):
        done = georeference(RUN, "--method", method, "--gnss", FIXES, "-o", folder / method, "--json")
        assert done.returncode in (0, 4), (method, done.stderr)
        told[method] = json.loads(done.stdout)
        off = error_of(folder / method)
        assert off < 3 * told[method]["expected_error_m"], (method, off, told[method])
        assert 20 < told[method]["gnss_correlation_s"] < 250, told[method]
        assert 1 < told[method]["gnss_independent_fixes"] < 100, told[method]
    best = min(told[m]["expected_error_m"] for m in ("closed", "fit3", "split"))
    assert told["auto"]["expected_error_m"] == best and told["auto"]["method"] == "split", told["auto"]
    assert error_of(folder / "auto") < 1.1 * error_of(folder / "closed")
    # By the IMU: 0.05 where the carrier turned through all headings, 0.25 where it kept its heading.
    assert 0.05 < told["split"]["sd_turn_east_deg"] < 0.26 < told["closed"]["sd_turn_east_deg"]
    text = georeference(RUN, "--method", "auto", "--gnss", FIXES, "-o", folder / "again").stdout
    assert "split has the smallest expected error" in text and "closed" in text, text
    rows = list(csv.DictReader((folder / "split" / "gnss.csv").open()))
    assert len(rows) == 600 and {row["used"] for row in rows} <= {"0", "1"}
    return ", ".join(f"{m} {error_of(folder / m):.1f} of {told[m]['expected_error_m']:.1f} m" for m in told)


@cases.case("a run without an IMU has its tilt from the heights, and a late clock is found")
def unlevel(folder):
    run = write_run(folder / "run", level=False)
    good = write_fixes(folder / "good.csv", received(0.05, height_factor=1.0), late_s=0.7)
    done = georeference(run, "--method", "split", "--gnss", good, "-o", folder / "a", "--json",
                        "--time-offset-sd-s", 1)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert abs(told["gnss_time_offset_s"] + 0.7) < 0.1, told
    assert told["sd_turn_east_deg"] < 1.0 and error_of(folder / "a") < 0.3, told


@cases.case("the positions of an RTKLIB solution give the same")
def rtklib(folder):
    lines = ["% program   : rnx2rtkp ver.2.4.3", "%  GPST   latitude(deg) longitude(deg)  height(m)   Q  ns"]
    for t, la, lo, h in received():
        seconds = 8 * 3600 + 30 * 60 + t + 18
        lines.append(f"2019/08/10 {int(seconds // 3600):02d}:{int(seconds // 60 % 60):02d}:"
                     f"{seconds % 60:06.3f} {la:.10f} {lo:.10f} {h:.4f} 5 8")
    path = folder / "walk.pos"
    path.write_text("\n".join(lines) + "\n")
    trajectories = []
    for name, fixes in (("pos", path), ("csv", FIXES)):
        done = georeference(RUN, "--method", "split", "--gnss", fixes, "-o", folder / name)
        assert done.returncode == 0, done.stderr
        trajectories.append((folder / name / "trajectory.tum").read_bytes())
    assert trajectories[0] == trajectories[1]


def write_points(path, wrong=None, count=5, by_time=False):
    """Control points in UTM zone 35, by the local turn and scale of the grid."""
    from_grid = []
    rows = ["name,east_m,north_m,height_m," + ("timestamp_s" if by_time else "x,y,z")]
    for k, (t, x, y, z) in enumerate(list(walk())[50::200][:count]):
        la, lo = degrees(x, y)
        from_grid.append((la, lo))
        e, n = utm35(la, lo)
        if k == wrong:
            e += 2.5
        place = f"{DAY + t}" if by_time else ",".join(f"{v:.4f}" for v in in_run(x, y, z))
        rows.append(f"N{k},{e:.4f},{n:.4f},{HEIGHT + z:.4f},{place}")
    path.write_text("\n".join(rows) + "\n")
    return path


def utm35(latitude_deg, longitude_deg):
    """By Krueger's series to the third order."""
    latitude, d = math.radians(latitude_deg), math.radians(longitude_deg - 27)
    f = 1 / 298.257223563
    n = f / (2 - f)
    big_a = 6378137.0 / (1 + n) * (1 + n * n / 4 + n**4 / 64)
    a = [n / 2 - 2 / 3 * n * n + 5 / 16 * n**3, 13 / 48 * n * n - 3 / 5 * n**3, 61 / 240 * n**3]
    k = 2 * math.sqrt(n) / (1 + n)
    t = math.sinh(math.atanh(math.sin(latitude)) - k * math.atanh(k * math.sin(latitude)))
    xi, eta = math.atan2(t, math.cos(d)), math.atanh(math.sin(d) / math.hypot(1, t))
    return (500000 + 0.9996 * big_a * (eta + sum(
        a[j] * math.cos(2 * (j + 1) * xi) * math.sinh(2 * (j + 1) * eta) for j in range(3))),
            0.9996 * big_a * (xi + sum(
                a[j] * math.sin(2 * (j + 1) * xi) * math.cosh(2 * (j + 1) * eta) for j in range(3))))


@cases.case("control points, seen in the map and stood on, and one blunder among them")
def points(folder):
    for by_time in (False, True):
        table = write_points(folder / f"points{by_time}.csv", by_time=by_time)
        done = georeference(RUN, "--method", "points", "--points", table, "--crs", "EPSG:32635", "-o",
                            folder / f"placed{by_time}", "--json")
        assert done.returncode == 0, done.stderr
        assert error_of(folder / f"placed{by_time}") < 0.1, error_of(folder / f"placed{by_time}")
    table = write_points(folder / "blunder.csv", wrong=2)
    done = georeference(RUN, "--method", "points", "--points", table, "--crs", "EPSG:32635", "-o",
                        folder / "blunder", "--json")
    assert done.returncode == 4 and "control point N2 (2.5" in done.stderr, done
    assert json.loads(done.stdout)["points_used"] == 4
    assert error_of(folder / "blunder") < 0.1
    table = write_points(folder / "three.csv", wrong=1, count=3)
    done = georeference(RUN, "--method", "points", "--points", table, "--crs", "EPSG:32635", "-o",
                        folder / "three")
    assert done.returncode == 4 and "cannot tell which" in done.stderr, done


@cases.case("fixes of another day, of one place, swapped, and none")
def bad(folder):
    def refused(code, word, *arguments):
        out = cases.folder / "refused"
        done = georeference(RUN, *arguments, "-o", out)
        assert done.returncode == code and word in done.stderr, (arguments, done)
        assert not out.exists(), arguments

    late = write_fixes(folder / "late.csv", received(), late_s=86400.0)
    for method in ("split", "fit3", "closed"):
        refused(3, "2019-08-11T08:30:00Z to", "--method", method, "--gnss", late)
    done = georeference(RUN, "--method", "auto", "--gnss", late, "-o", folder / "late")
    assert done.returncode == 4 and "2019-08-11T08:30:00Z" in done.stderr and "clock" in done.stdout, done
    # Where the paths alone cannot be compared either, only that was said.
    parked = write_fixes(folder / "parked.csv", ((t, LATITUDE, LONGITUDE, h) for t, _, _, h in received()), late_s=86400.0)
    for fixes in (late, parked):
        done = georeference(RUN, "--method", "auto", "--gnss", fixes, "-o", folder / f"auto {fixes.stem}")
        first = done.stderr.splitlines()[0]
        assert "do not overlap in time" in first and "2019-08-10T08:30:00Z" in first, done
    assert done.returncode == 3 and str(parked) in first and not (folder / "auto parked").exists(), done
    swapped = write_fixes(folder / "swapped.csv", ((t, lo, la, h) for t, la, lo, h in received()))
    refused(3, "seem to be swapped", "--method", "auto", "--gnss", swapped)
    still = folder / "still"
    still.mkdir()
    rows = [f"{DAY + t:.3f} 0 0 0 0 0 0 1" for t, *_ in walk()]
    (still / "trajectory.tum").write_text("\n".join(rows) + "\n")
    (still / "run.json").write_text((RUN / "run.json").read_text())
    done = georeference(still, "--method", "split", "--gnss", FIXES, "-o", folder / "x")
    assert done.returncode == 3 and "spans 0.0 m" in done.stderr, done
    flat = write_fixes(folder / "flat.csv", received())
    flat.write_text("\n".join(line.rsplit(",", 1)[0] for line in flat.read_text().splitlines()) + "\n")
    refused(3, "needs fixes with heights", "--method", "closed", "--gnss", flat)
    done = georeference(RUN, "--method", "split", "--gnss", flat, "-o", folder / "flat")
    assert done.returncode == 4 and "no heights" in done.stderr, done
    refused(3, "gnss.csv", "--method", "auto")
    refused(2, "--points FILE", "--method", "points")
    refused(2, "--crs", "--method", "points", "--points", FIXES)
    refused(3, "column", "--method", "points", "--points", FIXES, "--crs", "EPSG:32635")
    refused(2, "--points belongs", "--method", "split", "--points", FIXES)
    refused(2, "--tilt-sd-deg belongs", "--method", "gnss-path", "--gnss", FIXES, "--tilt-sd-deg", 1)


@cases.case("threads make no difference")
def threads(folder):
    made = []
    for n in (1, 2, 4):
        done = georeference(RUN, "--method", "auto", "--gnss", FIXES, "-o", folder / str(n), "--threads", n)
        assert done.returncode == 0, done.stderr
        made.append([(folder / str(n) / name).read_bytes() for name in ("trajectory.tum", "gnss.csv")])
    assert made[0] == made[1] == made[2]


cases.run()
