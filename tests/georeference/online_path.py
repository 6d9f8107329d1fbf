"""global.csv.gz of `map`: at every scan the place and heading on the globe with honest standard deviations, by nothing
but what was received until then; with --realtime, too."""

import csv
import gzip
import json
import math
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program

cases = Cases()
SKY = ("gnss.canopy_sd_m=0.3", "gnss.open_sd_m=0.1", "gnss.mount_m=[0.3,-0.2,1.1]")
RECORDING = cases.folder / "walk.mcap"
SECONDS = 45
done = program("simulate", "demo", "-o", RECORDING, "--seed", 6, "--duration-s", SECONDS,
               *(word for setting in ("lidar.model=VLP-16", *SKY) for word in ("--set", setting)))
assert done.returncode == 0, done.stderr


def mapped(folder, *more):
    done = program("map", RECORDING, "-o", folder, "--set", "map.enabled=false", *more)
    assert done.returncode in (0, 4), done.stderr
    return json.loads((folder / "run.json").read_text())


def table(run):
    with gzip.open(run / "global.csv.gz", "rt") as file:
        return [{key: float(value) if value else None for key, value in row.items()} for row in csv.DictReader(file)]


def truth():
    """East, north, up and heading by time, and the origin of that frame."""
    folder = cases.folder / "walk.truth"
    site = (folder / "site.yaml").read_text()
    origin = [float(re.search(rf"^  {key}: ([-\d.]+)", site, re.M)[1]) for key in ("latitude_deg", "longitude_deg", "height_m")]
    poses = {}
    for line in (folder / "trajectory.tum").read_text().splitlines():
        if line[0] != "#":
            stamp, x, y, z, qx, qy, qz, qw = map(float, line.split())
            east, north = 1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy + qw * qz)
            poses[round(stamp, 3)] = (x, y, z, math.degrees(math.atan2(east, north)))
    return origin, poses


def from_origin(row, origin):
    """East, north, up, right to a millimetre within 100 m."""
    s = math.sin(math.radians(origin[0]))
    w = 1 - 0.00669437999 * s * s
    meridian, across = 6378137 * (1 - 0.00669437999) / w ** 1.5, 6378137 / w ** 0.5
    return (math.radians(row["longitude_deg"] - origin[1]) * across * math.cos(math.radians(origin[0])),
            math.radians(row["latitude_deg"] - origin[0]) * meridian, row["height_m"] - origin[2])


def check_rows(rows, scans):
    origin, poses = truth()
    assert 0.8 * scans <= len(rows) <= scans, (len(rows), scans)
    known = [row for row in rows if row["latitude_deg"] is not None]
    assert len(known) > 0.8 * len(rows), len(known)
    wrong = 0
    for row in known:
        x, y, z, heading = poses[round(row["timestamp"], 3)]
        pairs = list(zip(from_origin(row, origin), (x, y, z), ("east", "north", "height")))
        off = [(is_at - should) / row[f"{name}_sd_m"] for is_at, should, name in pairs]
        if row["heading_deg"] is not None:
            off.append(math.remainder(row["heading_deg"] - heading, 360) / row["heading_sd_deg"])
        wrong += any(abs(one) > 3 for one in off)
    assert wrong <= 0.05 * len(known), (wrong, len(known))
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


@cases.case("at the speed of the sensors, too")
def realtime(folder):
    facts = mapped(folder / "run", "--realtime")
    check_rows(table(folder / "run"), facts["scans"])


@cases.case("by stems, too")
def stems(folder):
    mapped_run = folder / "run"
    done = program("map", "sim:lieksa2?seed=21&duration_s=40", "-o", mapped_run, "--front-end", "sparse")
    assert done.returncode in (0, 4), done.stderr
    assert any(row["latitude_deg"] for row in table(mapped_run))


@cases.case("switched off, there is no table and no figure")
def off(folder):
    facts = mapped(folder / "run", "--set", "georeference.online=false")
    assert not (folder / "run" / "global.csv.gz").exists()
    assert not [key for key in facts["quality"] if key.startswith("global_")], facts["quality"]


cases.run()
