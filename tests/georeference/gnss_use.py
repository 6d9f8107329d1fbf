"""`gnss.use` of `map`: positions by satellites as factors of the graph, or one motion beside it. The path keeps its
shape, the world frame is what the pages say, and bad positions are named. The antenna's place is kept for later."""

import json
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import GOOD_SKY, HALF_THE_SCANS, SCANS_PER_S, Cases, program, simulated

cases = Cases()
BAD_SKY = ("gnss.jump_interval_s=10", "gnss.burst_interval_s=15", "gnss.mount_m=[0.3,-0.2,1.1]")


def record(settings, seconds=30):
    return simulated("demo", 6, seconds, "lidar.model=VLP-16", *HALF_THE_SCANS, *settings)


def mapped(recording, folder, use, *more):
    done = program("map", recording, "-o", folder, "--set", f"gnss.use={use}", "--set", "map.enabled=false", *more)
    assert done.returncode in (0, 4), done.stderr
    return done, json.loads((folder / "run.json").read_text())


def poses(path):
    return [[float(word) for word in line.split()] for line in path.read_text().splitlines() if line[0] != "#"]


def ape(name, use):
    truth = {"good": GOOD, "bad": BAD}[name].with_suffix(".truth")
    done = program("evaluate", RUNS[name, use][0], truth, "--align", "se3", "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["ape_rmse_m"]


def turn(pose):
    x, y, z, w = pose["rotation_xyzw"]
    return math.degrees(2 * math.acos(min(1.0, abs(w))))


GOOD, BAD = record(GOOD_SKY), record(BAD_SKY)
RUNS = {(name, use): (cases.folder / f"{name}_{use}", *mapped(path, cases.folder / f"{name}_{use}", use))
        for name, path in (("good", GOOD), ("bad", BAD)) for use in ("georeference", "rigid", "fuse")}


@cases.case("fused, the world frame is east, north, up and the path is at its true place")
def fused(folder):
    run, _, facts = RUNS["good", "fuse"]
    place = facts["georeference"]
    assert place["on_globe"] and place["method"] == "fuse", place
    assert place["enu_from_world"]["translation_m"] == [0, 0, 0] and turn(place["enu_from_world"]) == 0, place
    assert "east, north and up of the place below" in (run / "report.html").read_text()
    figures = facts["quality"]
    assert [figures[f"motion_{axis}_m"] for axis in "xyz"] == [0, 0, 0], figures
    of_split = RUNS["good", "georeference"][2]["georeference"]["heading_sd_deg"]
    # Not the same figure: the fused path follows the fixes.
    assert abs(place["heading_sd_deg"] - of_split) < 0.2 * of_split, (place["heading_sd_deg"], of_split)
    # The truth is east, north, up of a place that is known; the run's is that of the first fix.
    truth = {round(row[0], 3): row for row in poses(GOOD.with_suffix(".truth") / "trajectory.tum")}
    north_m, east_m = 111_450.0, 111_320.0 * math.cos(math.radians(61.2)) * 1.0025
    north = (place["origin"]["latitude_deg"] - 61.2) * north_m
    east = (place["origin"]["longitude_deg"] - 25.1) * east_m
    off = [math.hypot(row[1] + east - truth[round(row[0], 3)][1], row[2] + north - truth[round(row[0], 3)][2])
           for row in poses(run / "trajectory.tum") if round(row[0], 3) in truth]
    assert len(off) > 25 * SCANS_PER_S and max(off) < 0.5, (len(off), max(off))
    return f"{100 * max(off):.0f} cm at most over {len(off)} poses"


@cases.case("jumps and bursts do not bend the path")
def unbent(folder):
    said = []
    for name in ("good", "bad"):
        before, after = ape(name, "georeference"), ape(name, "fuse")
        # A receiver that errs by 2 cm moves a path of millimetres by less than that.
        limit = 1.05 * before + 0.001 if name == "bad" else 0.02
        assert after <= limit, (name, before, after)
        said.append(f"{name}: {1000 * before:.1f} and {1000 * after:.1f} mm")
    return ", ".join(said)


@cases.case("one motion by split leaves every file in the world frame as it is")
def rigid(folder):
    for name in ("good", "bad"):
        run, _, facts = RUNS[name, "rigid"]
        plain, _, other = RUNS[name, "georeference"]
        for file in ("trajectory.tum", "states.csv.gz", "graph.g2o"):
            assert (run / file).read_bytes() == (plain / file).read_bytes(), (name, file)
        assert facts["georeference"]["on_globe"] and facts["georeference"]["method"] == "split", facts["georeference"]
        assert facts["georeference"]["origin"] == other["georeference"]["origin"]
        page = (run / "report.html").read_text()
        assert "In the frame of the run: trajectory.tum" in page and "of the place below" not in page, name
        place, figures = facts["georeference"], facts["quality"]
        moved = place["enu_from_world"]["translation_m"]
        assert [figures[f"motion_{axis}_m"] for axis in "xyz"] == moved, (name, figures)


@cases.case("a path that the fixes cannot place stays as it was, with a warning")
def short(folder):
    recording = record(BAD_SKY, 5)
    done, facts = mapped(recording, folder / "fuse", "fuse")
    plain, other = mapped(recording, folder / "plain", "georeference")
    assert "gnss.not_fused" in {w["key"] for w in facts["warnings"]}, facts["warnings"]
    assert done.returncode == plain.returncode and facts["status"] == other["status"]
    assert (folder / "fuse" / "trajectory.tum").read_bytes() == (folder / "plain" / "trajectory.tum").read_bytes()
    assert not facts["georeference"]["on_globe"] and facts["georeference"]["reason"]


@cases.case("a value that is none is refused")
def refused(folder):
    done = program("map", GOOD, "-o", folder / "run", "--set", "gnss.use=both")
    assert done.returncode == 2 and "georeference" in done.stderr and not (folder / "run").exists(), done


@cases.case("the antenna of a run is known when it is placed again")
def antenna(folder):
    run, _, facts = RUNS["bad", "georeference"]
    kept = facts["georeference"]["antenna_in_body_m"]
    assert len(kept) == 3 and math.hypot(*kept) > 0.5, kept
    found = {}
    for name, words in (("kept", ()), ("said", ("--antenna-m", *kept)), ("none", ("--antenna-m", 0, 0, 0))):
        done = program("georeference", run, "--method", "auto", "-o", folder / name, "--json", *words)
        assert done.returncode in (0, 4), done.stderr
        found[name] = [json.loads(done.stdout)[f"motion_{axis}_m"] for axis in "xyz"]
    assert found["kept"] == found["said"] != found["none"], found
    again = json.loads((folder / "kept" / "run.json").read_text())["georeference"]
    assert again["antenna_in_body_m"] == kept, again


cases.run()
