"""A recording with GNSS ends on the globe: map.laz, rasters, trees.gpkg and the QGIS project lie in the coordinate
system. Read with laspy, GDAL's tools where they are installed, and SQLite, and compared with formulas of its own."""

import csv
import json
import math
import re
import shutil
import sqlite3
import struct
import subprocess
import sys
import xml.etree.ElementTree as xml
from pathlib import Path

import laspy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, placed_recording, program, simulated

cases = Cases()
A, F = 6378137.0, 1 / 298.257223563


def geodetic(points, origin, pose):
    """Latitude, longitude (radians) and height of points of the world frame, by the earth's axes."""
    x, y, z, w = pose["rotation_xyzw"]
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    enu = np.asarray(points) @ turn.T + np.array(pose["translation_m"])
    e2 = F * (2 - F)
    phi, lam = math.radians(origin["latitude_deg"]), math.radians(origin["longitude_deg"])
    n = A / math.sqrt(1 - e2 * math.sin(phi) ** 2)
    h = origin["height_m"]
    start = np.array([(n + h) * math.cos(phi) * math.cos(lam), (n + h) * math.cos(phi) * math.sin(lam),
                      (n * (1 - e2) + h) * math.sin(phi)])
    axes = np.array([[-math.sin(lam), math.cos(lam), 0],
                     [-math.sin(phi) * math.cos(lam), -math.sin(phi) * math.sin(lam), math.cos(phi)],
                     [math.cos(phi) * math.cos(lam), math.cos(phi) * math.sin(lam), math.sin(phi)]])
    p = start + enu @ axes
    plane = np.hypot(p[:, 0], p[:, 1])
    latitude = np.arctan2(p[:, 2], plane * (1 - e2))
    for _ in range(6):
        n = A / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
        height = plane * np.cos(latitude) + p[:, 2] * np.sin(latitude) - n * (1 - e2 * np.sin(latitude) ** 2)
        latitude = np.arctan2(p[:, 2], plane * (1 - e2 * n / (n + height)))
    return latitude, np.arctan2(p[:, 1], p[:, 0]), height


def tm35fin(points, place):
    """East, north, height in EPSG:3067, by Krueger's series."""
    latitude, longitude, height = geodetic(points, place["origin"], place["enu_from_world"])
    f = 1 / 298.257222101
    n, e = f / (2 - f), math.sqrt(f * (2 - f))
    mean = A / (1 + n) * (1 + n * n / 4 + n ** 4 / 64)
    a = [n / 2 - 2 / 3 * n * n + 5 / 16 * n ** 3, 13 / 48 * n * n - 3 / 5 * n ** 3, 61 / 240 * n ** 3]
    s = np.sin(latitude)
    t = np.sinh(np.arctanh(s) - e * np.arctanh(e * s))
    d = longitude - math.radians(27)
    xi, eta = np.arctan2(t, np.cos(d)), np.arctanh(np.sin(d) / np.hypot(1, t))
    east, north = eta.copy(), xi.copy()
    for j in (1, 2, 3):
        east += a[j - 1] * np.cos(2 * j * xi) * np.sinh(2 * j * eta)
        north += a[j - 1] * np.sin(2 * j * xi) * np.cosh(2 * j * eta)
    return np.stack([500000 + 0.9996 * mean * east, 0.9996 * mean * north, height], axis=1)


def facts_of(run):
    return json.loads((run / "run.json").read_text())


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def trees_of(run):
    return np.array([[float(row[key]) for key in "xyz"] for row in rows_of(run / "trees.csv")])


def package(run):
    """Of trees.gpkg: srs_id of each layer, and the points of the trees."""
    with sqlite3.connect(run / "trees.gpkg") as base:
        systems = dict(base.execute("SELECT table_name, srs_id FROM gpkg_contents"))
        blobs = [row[0] for row in base.execute("SELECT geom FROM trees ORDER BY fid")]
    for blob in blobs:
        assert blob[:2] == b"GP" and struct.unpack("<i", blob[4:8])[0] == systems["trees"]
    return systems, np.array([struct.unpack("<3d", blob[13:37]) for blob in blobs])


def tool(name, *words):
    """What a program of GDAL says; empty where it is not installed."""
    if shutil.which(name) is None:
        return ""
    done = subprocess.run([name, *map(str, words)], capture_output=True, text=True)
    assert done.returncode == 0, (name, words, done.stderr)
    return done.stdout


RECORDING = placed_recording()
RUN, LOCAL = cases.folder / "run", cases.folder / "local"
FIRST = program("map", RECORDING, "-o", RUN)
SECOND = program("map", RECORDING, "-o", LOCAL, "--set", "georeference.enabled=false")


@cases.case("every layer lies in the system, by the full transform")
def placed(folder):
    assert FIRST.returncode in (0, 4), FIRST.stderr
    facts = facts_of(RUN)
    place = facts["georeference"]
    assert place["on_globe"] and place["coordinate_system"] == "EPSG:3067", place
    assert "TM35FIN" in facts["coordinate_system"]
    assert facts["frames"]["map.laz"] == facts["frames"]["trees.gpkg"] == "EPSG:3067"
    assert facts["frames"]["trajectory.tum"] == facts["frames"]["trees.csv"] == "world"
    assert facts["frames"]["global.csv.gz"] == "EPSG:4979"
    systems, points = package(RUN)
    assert systems == {"trees": 3067, "path": 3067, "look_again": 3067}, systems
    trees = trees_of(RUN)
    assert len(trees) == len(points) > 10, len(trees)
    off = np.abs(points - tm35fin(trees, place)).max()
    assert off < 0.0015, off
    # A shift alone would be wrong by decimetres: the grid is turned by 1.7 degrees here.
    assert abs(place["true_north_deg"] - 1.67) < 0.1 and abs(place["grid_scale"] - 0.99973) < 1e-4, place
    return f"{len(trees)} trees within {1000 * off:.1f} mm"


@cases.case("map.laz holds the same points as without a place")
def cloud(folder):
    las, local = laspy.read(RUN / "map.laz"), laspy.read(LOCAL / "map.laz")
    assert las.header.global_encoding.wkt and len(las.header.vlrs) == 1
    assert "TM35FIN" in las.header.vlrs[0].string, las.header.vlrs
    assert np.all(np.mod(las.header.offsets, 1000) == 0) and las.header.offsets[1] > 6e6
    assert len(local.header.vlrs) == 0 and len(las.points) == len(local.points) > 10_000
    off = np.abs(las.xyz - tm35fin(local.xyz, facts_of(RUN)["georeference"])).max()
    assert off < 0.002, off
    assert np.array_equal(las.gps_time, local.gps_time)
    assert np.array_equal(las.classification, local.classification)
    return f"{len(las.points)} points within {1000 * off:.1f} mm"


@cases.case("trees stand where the truth has them")
def true(folder):
    truth = np.array([[float(row[key]) for key in "xyz"] for row in rows_of(RECORDING.with_suffix(".truth") / "trees.csv")])
    origin = {"origin": {"latitude_deg": 61.2, "longitude_deg": 25.1, "height_m": 148.0},
              "enu_from_world": {"rotation_xyzw": [0, 0, 0, 1], "translation_m": [0, 0, 0]}}
    expected = tm35fin(truth, origin)
    _, points = package(RUN)
    apart = np.linalg.norm(points[:, None, :2] - expected[None, :, :2], axis=2)
    nearest = apart.argmin(axis=1)
    plane, height = np.median(apart.min(axis=1)), np.median(points[:, 2] - expected[nearest, 2])
    assert plane < 0.35 and abs(height) < 0.5, (plane, height)
    return f"{100 * plane:.0f} cm in the plane, {100 * height:.0f} cm in height"


@cases.case("rasters lie in the grid, as GDAL reads them")
def rasters(folder):
    if not shutil.which("gdalinfo"):
        return "GDAL's tools are not installed"
    _, points = package(RUN)
    for name in ("dtm.tif", "chm.tif", "dsm.tif"):
        info = json.loads(tool("gdalinfo", "-json", RUN / name))
        assert 'ID["EPSG",3067]' in info["coordinateSystem"]["wkt"], name
        step = info["geoTransform"]
        assert step[2] == step[4] == 0 and step[1] == -step[5] == 0.5, step
        assert "coordinateSystem" not in json.loads(tool("gdalinfo", "-json", LOCAL / name))
    at = [f"{value:.3f}" for value in points[0][:2]]
    ground, above, surface = (float(tool("gdallocationinfo", "-geoloc", "-valonly", RUN / name, *at))
                              for name in ("dtm.tif", "chm.tif", "dsm.tif"))
    assert above > 2 and abs(ground + above - surface) < 0.3, (ground, above, surface)
    heights = []
    for east, north, up in points[:10]:
        said = tool("gdallocationinfo", "-geoloc", "-valonly", RUN / "dtm.tif", f"{east:.3f}", f"{north:.3f}").strip()
        if said and float(said) > -9000:
            heights.append(float(said) - up)
    assert len(heights) > 5 and max(map(abs, heights)) < 0.4, heights
    said = tool("ogrinfo", "-so", "-al", RUN / "trees.gpkg")
    assert said.count('ID["EPSG",3067]') >= 2 and "Layer name: path" in said, said[:2000]
    return f"ground within {100 * max(map(abs, heights)):.0f} cm of the feet of trees"


@cases.case("the QGIS project opens the layers by relative paths")
def project(folder):
    for run, code in ((RUN, "EPSG:3067"), (LOCAL, None)):
        root = xml.parse(run / "map.qgs").getroot()
        sources = [layer.findtext("datasource") for layer in root.find("projectlayers")]
        assert sources == ["./trees.gpkg|layername=look_again", "./trees.gpkg|layername=trees",
                           "./trees.gpkg|layername=path", "./chm.tif", "./dsm.tif", "./dtm.tif", "./map.laz"], sources
        assert all((run / source.split("|")[0]).exists() for source in sources)
        assert root.findtext("projectCrs/spatialrefsys/authid") == (code or ""), code
        assert root.findtext("properties/Paths/Absolute") == "false"
        # Without it QGIS does not read the project's system.
        assert root.findtext("properties/SpatialRefSys/ProjectionsEnabled") == ("1" if code else "0")


@cases.case("without a place the layers are metres without a system")
def local(folder):
    assert SECOND.returncode == FIRST.returncode, SECOND.stderr
    facts = facts_of(LOCAL)
    assert facts["coordinate_system"] is None and not facts["georeference"]["on_globe"]
    assert facts["georeference"]["reason"] == "georeference.enabled is off"
    assert {frame for name, frame in facts["frames"].items() if name != "global.csv.gz"} == {"world"}, facts["frames"]
    systems, points = package(LOCAL)
    assert systems == {"trees": -1, "path": -1, "look_again": -1}, systems
    assert np.allclose(points, trees_of(LOCAL), atol=0.0006)
    for name in ("trajectory.tum", "trees.csv", "states.csv.gz", "graph.g2o"):
        assert (RUN / name).read_bytes() == (LOCAL / name).read_bytes(), name


@cases.case("a map that cannot be placed says why, and is as good as before")
def short(folder):
    done = program("map", simulated("demo", 4, 5, "lidar.model=VLP-16"), "-o", folder / "run")
    facts = facts_of(folder / "run")
    assert not facts["georeference"]["on_globe"] and facts["georeference"]["reason"], facts["georeference"]
    assert "gnss.not_placed" in {w["key"] for w in facts["warnings"]} and "no place on the globe" in done.stderr
    assert not any("globe" in reason for reason in facts["reasons"]), facts["reasons"]
    assert facts["georeference"]["reason"] in (folder / "run" / "report.html").read_text().replace("&gt;", ">")
    return facts["georeference"]["reason"]


@cases.case("another system, heights above the geoid, and what is no system")
def wished(folder):
    done = program("map", RECORDING, "-o", folder / "utm", "--crs", "EPSG:32635+5773")
    assert done.returncode == FIRST.returncode, done.stderr
    place = facts_of(folder / "utm")["georeference"]
    by_geoid = "geoid" in place["heights"]
    systems, points = package(folder / "utm")
    _, before = package(RUN)
    assert place["coordinate_system"] == ("EPSG:32635+5773" if by_geoid else "EPSG:32635"), place
    assert np.abs(points[:, :2] - before[:, :2]).max() < 0.01  # both have 27 degrees in the middle
    shift = before[:, 2] - points[:, 2]
    assert (17 < shift.min() and shift.max() < 20) if by_geoid else np.abs(shift).max() < 0.01, shift
    assert by_geoid or "no grid of the geoid" in done.stderr
    for word in ("EPSG:1", "metres"):
        done = program("map", RECORDING, "-o", folder / "none", "--crs", word)
        assert done.returncode == 2 and "no coordinate system" in done.stderr, done
        assert not (folder / "none").exists()
    return place["heights"]


@cases.case("inventory keeps the frames of a run and the system of a cloud")
def inventory(folder):
    for name, source in (("run", RUN), ("cloud", RUN / "map.laz")):
        done = program("inventory", source, "-o", folder / name, "--set", "extent=basic")
        assert done.returncode in (0, 4), done.stderr
        assert "TM35FIN" in facts_of(folder / name)["coordinate_system"], name
        assert package(folder / name)[0] == {"trees": 3067, "look_again": 3067}
        title = "run" if name == "run" else "map.laz"
        assert f"<h1>{title}</h1>" in (folder / name / "report.html").read_text(), title
    expected, found = trees_of(RUN), trees_of(folder / "run")
    apart = np.linalg.norm(found[:, None] - expected[None], axis=2).min(axis=1)
    # The map's points are rounded to millimetres: a doubtful stem of a sparse lidar may come or go.
    assert abs(len(found) - len(expected)) <= 0.05 * len(expected), (len(found), len(expected))
    assert np.median(apart) < 0.01 and np.mean(apart < 0.1) > 0.9, np.mean(apart < 0.1)
    assert trees_of(folder / "cloud")[:, 1].min() > 6e6  # a cloud has no other frame than its own
    done = program("inventory", RUN / "map.laz", "-o", folder / "no", "--crs", "EPSG:32635")
    assert done.returncode == 2 and "names no coordinate system" in done.stderr, done
    done = program("inventory", LOCAL / "map.laz", "-o", folder / "named", "--crs", "EPSG:32635", "--set", "extent=basic")
    assert done.returncode in (0, 4), done.stderr
    assert package(folder / "named")[0] == {"trees": 32635, "look_again": 32635}


@cases.case("a run on the globe is placed again, in its system or another")
def again(folder):
    for name, more, code in (("kept", (), 3067), ("utm", ("--crs", "EPSG:32635"), 32635)):
        done = program("georeference", RUN, "--method", "auto", "--antenna-m", 0, 0, 0.15, "-o", folder / name, *more)
        assert done.returncode == FIRST.returncode, done.stderr
        assert re.search(r"worth (1 independent fix|([02-9]|\d\d+) independent fixes)\n", done.stdout), done.stdout
        systems, points = package(folder / name)
        assert set(systems.values()) == {code}, systems
        off = np.abs(points - package(RUN)[1]).max()
        assert off < 0.05, (name, off)
        las, before = laspy.read(folder / name / "map.laz"), laspy.read(RUN / "map.laz")
        assert np.abs(las.xyz[::50] - before.xyz[::50]).max() < 0.05
        page = (folder / name / "report.html").read_text()
        for word in ("Where it is", "mean diameter at 1.3 m", 'class="grid"', "height, m", "data:image/png"):
            assert word in page, (name, word)
        assert "Heights are not measured" not in page and "var(--lost)" not in page
        assert "without satellite positions" not in page and "Nothing stood out" not in page
        world = facts_of(folder / name)
        assert world["georeference"]["enu_from_world"]["translation_m"] == [0, 0, 0], world["georeference"]
        check_stand(RUN, folder / name)
    done = program("georeference", folder / "kept", "--method", "auto", "-o", folder / "twice")
    assert done.returncode == FIRST.returncode, done.stderr
    check_stand(folder / "kept", folder / "twice")


def check_stand(run, moved):
    """What is told of the stand does not change where it is moved, and the page says what it does not hold."""
    before, after = facts_of(run), facts_of(moved)
    for name in ("area_m2", "seen_area_m2", "stems_per_ha", "stems_per_ha_sd", "basal_area_m2_per_ha", "mean_dbh_m"):
        assert after["quality"][name] == before["quality"][name], name
    for name in ("trees_in_seen_area", "diameters_doubtful", "look_again_places"):
        assert after["counts"][name] == before["counts"][name], name
    pages = [(folder / "report.html").read_text() for folder in (run, moved)]
    for label in ("area seen (not a plot's border)", "stems per hectare", "basal area, m² per hectare"):
        shown = [re.search(f"<b>([^<]*)</b><span>{re.escape(label)}</span>", page.replace("&#39;", "'")) for page in pages]
        assert shown[0] and shown[1] and shown[0][1] == shown[1][1], (label, shown)
    assert "stems per hectare seen" not in pages[1] and "<h2>Stand figures</h2>" in pages[1]
    for note in before["notes"]:
        assert note.split(". See")[0] in pages[1].replace("&gt;", ">"), note
    kept = [w for w in before["warnings"] if not w["key"].startswith(("gnss", "georeference"))]
    assert [w for w in after["warnings"] if w in kept] == kept, (kept, after["warnings"])
    left = [name for name in ("states.csv.gz", "graph.g2o", "global.csv.gz") if (run / name).exists()]
    assert all(f"<code>{name}</code>" in pages[1] for name in left), left


cases.run()
