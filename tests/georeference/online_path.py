"""global.csv.gz of `map`: at every scan the place and heading on the globe, with honest standard
deviations. Nothing but what was received until then counts; with --realtime, too."""

import csv
import gzip
import json
import math
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import HALF_THE_SCANS, SCANS_PER_S, Cases, program, simulated

cases = Cases()
# The antenna is far off the body: who forgets the lever arm is metres off.
SKY = ("gnss.canopy_sd_m=0.3", "gnss.open_sd_m=0.1", "gnss.mount_m=[0.3,-0.2,4.1]")
# Errors as large as they are taken to be before the fixes tell: small ones lie within any standard deviation.
TREES = ("gnss.canopy_sd_m=1.5", "gnss.open_sd_m=1.5", "gnss.mount_m=[0.3,-0.2,1.1]")


def walked(sky):
    return simulated("demo", 6, 36, "lidar.model=VLP-16", *HALF_THE_SCANS, *sky)


RECORDING = walked(SKY)


def mapped(folder, *more, recording=RECORDING):
    done = program("map", recording, "-o", folder, "--set", "map.enabled=false", *more)
    assert done.returncode in (0, 4), done.stderr
    return json.loads((folder / "run.json").read_text())


def table(run):
    with gzip.open(run / "global.csv.gz", "rt") as file:
        return [{key: float(value) if value else None for key, value in row.items()} for row in csv.DictReader(file)]


def truth(recording=RECORDING):
    """East, north, up, heading, roll and pitch by time, and the origin of that frame."""
    folder = recording.with_suffix(".truth")
    site = (folder / "site.yaml").read_text()
    origin = [float(re.search(rf"^  {key}: ([-\d.]+)", site, re.M)[1]) for key in ("latitude_deg", "longitude_deg", "height_m")]
    poses = {}
    for line in (folder / "trajectory.tum").read_text().splitlines():
        if line[0] != "#":
            stamp, x, y, z, qx, qy, qz, qw = map(float, line.split())
            east, north = 1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy + qw * qz)
            roll = math.atan2(2 * (qy * qz + qw * qx), 1 - 2 * (qx * qx + qy * qy))
            pitch = math.asin(2 * (qw * qy - qx * qz))
            poses[round(stamp, 3)] = (x, y, z, *map(math.degrees, (math.atan2(east, north), roll, pitch)))
    return origin, poses


def from_origin(row, origin):
    """East, north, up, right to a millimetre within 100 m."""
    s = math.sin(math.radians(origin[0]))
    w = 1 - 0.00669437999 * s * s
    meridian = 6378137 * (1 - 0.00669437999) / w ** 1.5 + origin[2]
    across = 6378137 / w ** 0.5 + origin[2]
    return (math.radians(row["longitude_deg"] - origin[1]) * across * math.cos(math.radians(origin[0])),
            math.radians(row["latitude_deg"] - origin[0]) * meridian, row["height_m"] - origin[2])


def tm35fin(latitude_deg, longitude_deg):
    """Easting and northing by the series of Krueger, to a millimetre (JHS 197)."""
    n = 1 / 298.257222101 / (2 - 1 / 298.257222101)
    radius = 6378137 / (1 + n) * (1 + n * n / 4 + n ** 4 / 64)
    e = 2 * math.sqrt(n) / (1 + n)
    series = (n / 2 - 2 * n * n / 3 + 5 * n ** 3 / 16, 13 * n * n / 48 - 3 * n ** 3 / 5, 61 * n ** 3 / 240)
    phi, turn = math.radians(latitude_deg), math.radians(longitude_deg - 27)
    q = math.asinh(math.tan(phi)) - e * math.atanh(e * math.sin(phi))
    beta = math.atan(math.sinh(q))
    eta = math.atanh(math.cos(beta) * math.sin(turn))
    xi = math.asin(math.sin(beta) * math.cosh(eta))
    north, east = xi, eta
    for k, h in enumerate(series, 1):
        north += h * math.sin(2 * k * xi) * math.cosh(2 * k * eta)
        east += h * math.cos(2 * k * xi) * math.sinh(2 * k * eta)
    return 500000 + 0.9996 * radius * east, 0.9996 * radius * north


def normalised(rows, recording=RECORDING):
    """Errors of the known rows in their standard deviations, by degree of freedom."""
    origin, poses = truth(recording)
    off = {name: [] for name in ("east", "north", "height", "heading", "tilt")}
    for row in rows:
        if row["latitude_deg"] is None:
            continue
        x, y, z, heading, roll, pitch = poses[round(row["timestamp"], 3)]
        for is_at, should, name in zip(from_origin(row, origin), (x, y, z), off):
            off[name].append((is_at - should) / row[f"{name}_sd_m"])
        if row["heading_deg"] is not None:
            off["heading"].append(math.remainder(row["heading_deg"] - heading, 360) / row["heading_sd_deg"])
            off["tilt"].append(math.hypot(row["roll_deg"] - roll, row["pitch_deg"] - pitch) /
                               math.hypot(row["turn_east_sd_deg"], row["turn_north_sd_deg"]))
    return off


def check_rows(rows, scans):
    origin, poses = truth()
    assert 0.8 * scans <= len(rows) <= scans, (len(rows), scans)
    known = [row for row in rows if row["latitude_deg"] is not None]
    assert len(known) > 0.8 * len(rows), len(known)
    wrong = 0
    for row in known:
        x, y, z, heading, _, _ = poses[round(row["timestamp"], 3)]
        pairs = list(zip(from_origin(row, origin), (x, y, z), ("east", "north", "height")))
        off = [(is_at - should) / row[f"{name}_sd_m"] for is_at, should, name in pairs]
        if row["heading_deg"] is not None:
            off.append(math.remainder(row["heading_deg"] - heading, 360) / row["heading_sd_deg"])
        wrong += any(abs(one) > 3 for one in off)
        apart = math.dist(tm35fin(row["latitude_deg"], row["longitude_deg"]), (row["easting"], row["northing"]))
        assert apart < 0.003, (apart, row)
    assert wrong <= 0.05 * len(known), (wrong, len(known))
    assert max(normalised(rows)["tilt"]) < 3, max(normalised(rows)["tilt"])
    last = rows[-1]
    assert last["heading_sd_deg"] < 5 and last["east_sd_m"] < 1.5, last
    return known


@cases.case("each scan has its place on the globe within what is stated")
def whole(folder):
    facts = mapped(folder / "run")
    rows = table(folder / "run")
    known = check_rows(rows, facts["scans"])
    quality = facts["quality"]
    assert quality["global_coordinate_system"] == "EPSG:3067", quality
    assert abs(quality["global_known_percent"] - 100 * len(known) / len(rows)) < 1e-6, quality
    # The uncertainty falls while the body walks.
    assert known[-1]["east_sd_m"] < 0.7 * known[0]["east_sd_m"], (known[0], known[-1])


@cases.case("errors of metres lie within what is stated, and what is stated is not three times too small")
def trees(folder):
    recording = walked(TREES)
    mapped(folder / "run", recording=recording)
    rows = table(folder / "run")
    off = normalised(rows, recording)
    text = []
    for name, errors in off.items():
        far = sum(abs(one) > 1.6 for one in errors)
        text.append(f"{name} {math.sqrt(sum(one * one for one in errors) / len(errors)):.2f}")
        # One walk, whose errors stay alike: it shows too small a deviation, no too large one.
        assert len(errors) > 20 * SCANS_PER_S and far <= 0.01 * len(errors), (name, far, len(errors))
    print("errors over standard deviations, root mean square: " + ", ".join(text))
    # Nothing that comes later counts: the same rows come of a recording that is cut short.
    cut = cases.folder / "cut.mcap"
    whole = recording.read_bytes()
    cut.write_bytes(whole[:len(whole) // 2])
    mapped(folder / "cut", recording=cut)
    begin = [row for row in table(folder / "cut") if row["latitude_deg"] is not None]
    by_time = {row["timestamp"]: row for row in rows}
    assert len(begin) > 10 * SCANS_PER_S, len(begin)
    for row in begin[:-2 * SCANS_PER_S]:
        assert row == by_time[row["timestamp"]], (row, by_time[row["timestamp"]])


@cases.case("at the speed of the sensors, too")
def realtime(folder):
    facts = mapped(folder / "run", "--realtime")
    check_rows(table(folder / "run"), facts["scans"])


@cases.case("by stems, too")
def stems(folder):
    mapped_run = folder / "run"
    done = program("map", simulated("lieksa2", 21, 60), "-o", mapped_run, "--front-end", "sparse")
    assert done.returncode in (0, 4), done.stderr
    assert any(row["latitude_deg"] for row in table(mapped_run))


@cases.case("switched off, there is no table and no figure")
def off(folder):
    facts = mapped(folder / "run", "--set", "georeference.online=false")
    assert not (folder / "run" / "global.csv.gz").exists()
    assert not [key for key in facts["quality"] if key.startswith("global_")], facts["quality"]


cases.run()
