"""Headings of a second antenna, by its sentences and by its positions. They lay the map within the
stated error and place a machine that stands. Headings that contradict the positions, or are those of
another line, are noticed."""

import csv
import json
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import HALF_THE_SCANS, Cases, program, simulated

cases = Cases()
ANTENNAS = ("gnss.mount_m=[0.2,-0.3,0.4]", "gnss.second_antenna_m=[0.1,0.8,0.05]")
# A receiver that errs by metres: a short path tells the heading to some degrees only.
RECEIVER = ("gnss.open_sd_m=1.5", "gnss.canopy_sd_m=1", "gnss.correlation_s=30")


def recorded(site, seconds, *settings):
    return simulated(site, 5, seconds, "lidar.model=VLP-16", *HALF_THE_SCANS, *ANTENNAS, *RECEIVER, *settings)


def yaw_of(x, y, z, w):
    return math.degrees(math.atan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z)))


def yaws(file, before=0.0):
    rows = [list(map(float, line.split())) for line in file.read_text().splitlines() if line[0] != "#"]
    return {round(row[0], 3): before + yaw_of(*row[4:8]) for row in rows}


def heading_error_deg(recording, run, facts):
    """Of the run on the globe against the simulator's truth, which is east, north, up."""
    turn = yaw_of(*facts["georeference"]["enu_from_world"]["rotation_xyzw"])
    truth = yaws(recording.with_suffix(".truth") / "trajectory.tum")
    off = [math.remainder(yaw - truth[time], 360) for time, yaw in yaws(run / "trajectory.tum", turn).items()]
    return sum(off) / len(off)


def mapped(recording, folder, *more, want=(0, 4)):
    done = program("map", recording, "-o", folder, "--set", "map.enabled=false", *more)
    assert done.returncode in want, done.stderr
    return json.loads((folder / "run.json").read_text())


def warned(facts, kind):
    return [warning for warning in facts["warnings"] if warning["key"] == kind]


WALK = recorded("demo", 25)


@cases.case("the heading is right within what is stated, and better than by positions alone")
def walk(folder):
    facts = mapped(WALK, folder / "run")
    quality, place = facts["quality"], facts["georeference"]
    assert quality["gnss_second_antenna_used"] == 1, quality
    assert place["second_antenna_in_body_m"], place
    error = heading_error_deg(WALK, folder / "run", facts)
    assert abs(error) < 3 * place["heading_sd_deg"], (error, place)
    assert place["heading_sd_deg"] < 1.5, place
    # gnss.csv keeps the headings, so that `georeference` uses them later.
    for method in ("split", "auto"):
        done = program("georeference", folder / "run", "--method", method, "-o", folder / method, "--json")
        assert done.returncode in (0, 4), done.stderr
        figures = json.loads(done.stdout)
        assert figures["gnss_second_antenna_used"] == 1 and figures["sd_heading_deg"] < 1.5, figures
    # A place for the antenna alone leaves the headings out.
    done = program("georeference", folder / "run", "--method", "split", "--antenna-m", 0.2, -0.3, 0.4, "-o",
                   folder / "alone", "--json")
    assert done.returncode in (0, 4), done.stderr
    assert warned(json.loads((folder / "alone" / "run.json").read_text()), "gnss.second_antenna")
    alone = json.loads(done.stdout)["sd_heading_deg"]
    print(f"heading: off by {error:.2f} degrees, stated {place['heading_sd_deg']:.2f}, by positions alone {alone:.2f}")
    assert alone > 2 * place["heading_sd_deg"], (alone, place)


@cases.case("antennas that are swapped are noticed and do not turn the map")
def swapped(folder):
    swap = folder / "swapped.yaml"
    swap.write_text("body_from_gnss: {translation_m: [0.3, 0.5, 0.45]}\n"
                    "body_from_second_gnss: {translation_m: [0.2, -0.3, 0.4]}\n")
    facts = mapped(WALK, folder / "run", "--extrinsics", swap)
    assert facts["quality"]["gnss_second_antenna_used"] == 0, facts["quality"]
    assert abs(facts["quality"]["gnss_second_antenna_off_deg"]) > 150, facts["quality"]
    assert warned(facts, "gnss.second_antenna_contradicts"), facts["warnings"]
    if facts["georeference"]["on_globe"]:
        assert abs(heading_error_deg(WALK, folder / "run", facts)) < 20


@cases.case("a machine that stands is placed by its heading, and not without")
def standing(folder):
    recording = recorded("harvester", 8, "carrier.still_s=60")
    facts = mapped(recording, folder / "run")
    place = facts["georeference"]
    assert place["on_globe"], place
    assert place["heading_sd_deg"] < 3, place
    error = heading_error_deg(recording, folder / "run", facts)
    print(f"standing: off by {error:.2f} degrees, stated {place['heading_sd_deg']:.2f}")
    assert abs(error) < 3 * place["heading_sd_deg"], (error, place)
    assert facts["quality"]["global_heading_known_percent"] > 50, facts["quality"]
    bare = recorded("harvester", 8, "carrier.still_s=60", "gnss.second_antenna_m=[0,0,0]")
    place = mapped(bare, folder / "bare")["georeference"]
    assert not place["on_globe"] and "to tell the heading" in place["reason"], place


@cases.case("the graph takes the headings, too")
def fused(folder):
    facts = mapped(WALK, folder / "run", "--set", "gnss.use=fuse")
    assert facts["georeference"]["method"] == "fuse", facts["georeference"]
    error = heading_error_deg(WALK, folder / "run", facts)
    assert abs(error) < 3 * max(0.5, facts["georeference"]["heading_sd_deg"]), (error, facts["georeference"])


# Two receivers that give positions: they err alike by a metre, and each by centimetres. They promise one.
POSITIONS = ("gnss.second_antenna_positions=true", "gnss.second_antenna_common=0.9992", "gnss.open_sd_m=1",
             "gnss.canopy_sd_m=0", "gnss.white_sd_m=0.005", "gnss.reported_factor=0.01")
PAIR = recorded("demo", 25, *POSITIONS)
LINE_DEG = math.degrees(math.atan2(0.8, 0.1))  # of the second antenna in the body's plane, from x to y


def normalised_errors(run, recording, turn_deg):
    """Of the headings in gnss.csv against the truth, in standard deviations. The body is nearly level."""
    truth = yaws(recording.with_suffix(".truth") / "trajectory.tum")
    off = []
    with (run / "gnss.csv").open() as file:
        for row in csv.DictReader(file):
            time = min(truth, key=lambda stamp: abs(stamp - float(row["timestamp"])))
            if not row["heading_deg"] or row["heading_deg"] == "nan" or abs(time - float(row["timestamp"])) > 0.06:
                continue
            should = 90 - truth[time] - LINE_DEG + turn_deg
            off.append(math.remainder(float(row["heading_deg"]) - should, 360) / float(row["heading_sd_deg"]))
    return off


@cases.case("positions of two antennas tell the heading, as well as is stated")
def positions(folder):
    told = json.loads(program("info", PAIR, "--json").stdout)
    assert told["gnss"]["headings"] > 80, told["gnss"]
    facts = mapped(PAIR, folder / "run")
    quality, place = facts["quality"], facts["georeference"]
    assert quality["gnss_second_antenna_used"] == 1, quality
    assert not warned(facts, "recording.second_antenna") and not warned(facts, "recording.antenna_distance"), facts
    error = heading_error_deg(PAIR, folder / "run", facts)
    assert abs(error) < 3 * place["heading_sd_deg"] and place["heading_sd_deg"] < 2.5, (error, place)
    off = normalised_errors(folder / "run", PAIR, 0.0)
    square = sum(one * one for one in off) / len(off)
    print(f"by positions: off by {error:.2f} degrees, stated {place['heading_sd_deg']:.2f}; {len(off)} headings, "
          f"normalised square {square:.2f}, off from those of the path by {quality['gnss_second_antenna_off_deg']:.2f}")
    assert len(off) > 80 and 0.2 < square < 2.5, (len(off), square)
    assert abs(quality["gnss_second_antenna_off_deg"]) < 20, quality  # the positions err by metres over 27 m


@cases.case("a machine that stands is placed by the positions of two antennas, and says so while it runs")
def standing_positions(folder):
    recording = recorded("harvester", 8, "carrier.still_s=60", *POSITIONS)
    facts = mapped(recording, folder / "run")
    place = facts["georeference"]
    assert place["on_globe"] and place["heading_sd_deg"] < 5, place
    error = heading_error_deg(recording, folder / "run", facts)
    print(f"standing, by positions: off by {error:.2f} degrees, stated {place['heading_sd_deg']:.2f}")
    assert abs(error) < 3 * place["heading_sd_deg"], (error, place)
    assert facts["quality"]["global_heading_known_percent"] > 50, facts["quality"]


@cases.case("the graph takes the headings by positions, too")
def fused_positions(folder):
    facts = mapped(PAIR, folder / "run", "--set", "gnss.use=fuse")
    assert facts["georeference"]["method"] == "fuse", facts["georeference"]
    assert facts["quality"]["gnss_second_antenna_used"] == 1, facts["quality"]
    error = heading_error_deg(PAIR, folder / "run", facts)
    assert abs(error) < 3 * max(0.5, facts["georeference"]["heading_sd_deg"]), (error, facts["georeference"])


def rig_file(path, first, second):
    path.write_text(f"body_frame: {json.loads(program('info', PAIR, '--json').stdout)['rig']['body_frame']}\n"
                    f"body_from_gnss: {{translation_m: {first}}}\nbody_from_second_gnss: {{translation_m: {second}}}\n")
    return path


@cases.case("positions of antennas that are swapped, or not as far apart as the rig says, do not turn the map")
def wrong_positions(folder):
    swap = rig_file(folder / "swapped.yaml", [0.3, 0.5, 0.45], [0.2, -0.3, 0.4])
    facts = mapped(PAIR, folder / "swapped", "--extrinsics", swap, "--gnss-topic", "/gnss")
    assert facts["quality"]["gnss_second_antenna_used"] == 0, facts["quality"]
    assert warned(facts, "gnss.second_antenna_contradicts"), facts["warnings"]
    far = rig_file(folder / "far.yaml", [0.2, -0.3, 0.4], [0.3, 1.5, 0.45])
    facts = mapped(PAIR, folder / "far", "--extrinsics", far, "--gnss-topic", "/gnss")
    assert "gnss_second_antenna_used" not in facts["quality"], facts["quality"]
    assert "pairs of positions" in warned(facts, "recording.antenna_distance")[0]["message"], facts["warnings"]
    # A file that places the antennas, and nothing says which topic is whose.
    facts = mapped(PAIR, folder / "unnamed", "--extrinsics", far)
    assert "--gnss-topic" in warned(facts, "recording.second_antenna")[0]["message"], facts["warnings"]


cases.run()
