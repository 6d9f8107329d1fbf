"""Headings of a second antenna: they lay the map within what is stated, place a machine that stands, and are noticed
where they contradict the positions."""

import json
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program

cases = Cases()
ANTENNAS = ("gnss.mount_m=[0.2,-0.3,0.4]", "gnss.second_antenna_m=[0.1,0.8,0.05]")
# A receiver that errs by metres: a short path tells the heading to some degrees only.
RECEIVER = ("gnss.open_sd_m=1.5", "gnss.canopy_sd_m=1", "gnss.correlation_s=30")


def simulated(name, site, seconds, *settings):
    words = [word for setting in ("lidar.model=VLP-16", *ANTENNAS, *RECEIVER, *settings) for word in ("--set", setting)]
    done = program("simulate", site, "-o", cases.folder / f"{name}.mcap", "--seed", 5, "--duration-s", seconds, *words)
    assert done.returncode == 0, done.stderr
    return cases.folder / f"{name}.mcap"


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


WALK = simulated("walk", "demo", 25)


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
    recording = simulated("still", "harvester", 12, "carrier.still_s=60")
    facts = mapped(recording, folder / "run")
    place = facts["georeference"]
    assert place["on_globe"], place
    assert place["heading_sd_deg"] < 3, place
    error = heading_error_deg(recording, folder / "run", facts)
    print(f"standing: off by {error:.2f} degrees, stated {place['heading_sd_deg']:.2f}")
    assert abs(error) < 3 * place["heading_sd_deg"], (error, place)
    assert facts["quality"]["global_heading_known_percent"] > 50, facts["quality"]
    bare = simulated("bare", "harvester", 12, "carrier.still_s=60", "gnss.second_antenna_m=[0,0,0]")
    place = mapped(bare, folder / "bare")["georeference"]
    assert not place["on_globe"] and "to tell the heading" in place["reason"], place


@cases.case("the graph takes the headings, too")
def fused(folder):
    facts = mapped(WALK, folder / "run", "--set", "gnss.use=fuse")
    assert facts["georeference"]["method"] == "fuse", facts["georeference"]
    error = heading_error_deg(WALK, folder / "run", facts)
    assert abs(error) < 3 * max(0.5, facts["georeference"]["heading_sd_deg"]), (error, facts["georeference"])


cases.run()
