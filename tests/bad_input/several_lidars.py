"""Machines with two lidars: merged by the whole program, whatever happens to one of them, and what is said then."""

import array
import json

from program import Cases, map_recording, program, rewritten, simulated
from recordings import edit_cloud

cases = Cases()
SMALL = ["stand.size_x_m=60", "stand.size_y_m=60", "gnss.enabled=false", "carrier.length_m=30", "carrier.turn_interval_s=3"]
SECONDS = 12
BOTH = ("--lidar-topic", "/lidar,/lidar_2")


WALK = simulated("harvester2", 5, SECONDS, *SMALL)
START = 1_700_000_000 * 10**9  # of every simulation


def behind(offsets_s):
    """Clocks of lidars that are off, by topic, as the simulation plays them: what is late arrives late."""
    return lambda m: m.at(m.stamp + round(1e9 * offsets_s[m.topic])) if m.topic in offsets_s else m


def info_of(recording, *options):
    done = program("info", recording, "--json", *options)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def points_of(info, topic):
    return next(t["points"] for t in info["topics"] if t["name"] == topic)


@cases.case("both lidars are in the scans, and info lists both")
def merged(folder):
    info, alone = info_of(WALK, *BOTH), info_of(WALK)
    assert {t["name"] for t in info["topics"] if t["role"] == "lidar"} == {"/lidar", "/lidar_2"}, info["topics"]
    assert info["lidar"]["rings"] == 32 and info["lidar"]["outages"] == 0, info["lidar"]
    assert abs(info["lidar"]["scans"] - alone["lidar"]["scans"]) <= 2, info["lidar"]
    both = points_of(info, "/lidar") + points_of(info, "/lidar_2")
    assert info["lidar"]["points"] == both > 1.8 * alone["lidar"]["points"], (both, info["lidar"])
    outcome = map_recording(WALK, folder / "run", *BOTH)
    assert outcome.code == 0, (outcome.code, outcome.said)
    return f"{both} points"


@cases.case("a merged recording that is converted is the same again, also by stems")
def converted(folder):
    again = folder / "again.mcap"
    assert program("convert", WALK, again, *BOTH).returncode == 0
    assert info_of(again)["lidar"]["rings"] == info_of(WALK, *BOTH)["lidar"]["rings"] == 32
    tables = []
    for name, recording, options in (("a", WALK, BOTH), ("b", again, ())):
        table = folder / f"{name}.csv.gz"
        done = program("convert", recording, table, *options)
        assert done.returncode == 0, done.stderr
        tables.append(table.read_bytes())
    assert tables[0] == tables[1]
    stems = program("map", WALK, "-o", folder / "stems", *BOTH, "--front-end", "sparse")
    assert stems.returncode in (0, 4), stems
    poses = (folder / "stems" / "trajectory.tum").read_text().splitlines()
    assert len(poses) > 9 * SECONDS, len(poses)
    return f"{len(poses)} poses by stems"


@cases.case("one that dies leaves the other: partial, with the time")
def dies(folder):
    recording = rewritten(folder / "dies.mcap", WALK,
                          lambda m: m if m.topic != "/lidar_2" or m.time < START + 6e9 else None)
    outcome = map_recording(recording, folder / "run", *BOTH)
    assert outcome.code == 4 and outcome.run["status"] == "partial", (outcome.code, outcome.run["status"])
    warning = outcome.warnings["recording.silent_lidar"]
    assert warning["count"] == 1 and "/lidar_2 gives nothing after 1700000005.9" in warning["message"], warning
    assert len(outcome.poses) >= 10 * SECONDS - 3, len(outcome.poses)
    return warning["message"]


@cases.case("one that begins late joins, and all its points are read")
def begins_late(folder):
    recording = rewritten(folder / "late.mcap", WALK,
                          lambda m: m if m.topic != "/lidar_2" or m.stamp >= START + 5e9 else None)
    outcome = map_recording(recording, folder / "run", *BOTH)
    assert outcome.code == 0 and "recording.silent_lidar" not in outcome.warnings, outcome.said
    warning = outcome.warnings["recording.late_lidar"]
    assert "5.0 s after the first lidar" in warning["message"] or "5.1 s" in warning["message"], warning
    info = info_of(recording, *BOTH)
    assert info["lidar"]["points"] == points_of(info, "/lidar") + points_of(info, "/lidar_2")
    return warning["message"]


@cases.case("clocks that differ are told: by 20 ms in a warning, by 0.1 s the run is untrusted")
def differing_clocks(folder):
    assert not {"lidars.clock", "lidars.place"} & set(map_recording(WALK, folder / "right", *BOTH).warnings)
    said = []
    longer = simulated("harvester2", 5, 25, *SMALL, "stand.size_x_m=100", "stand.size_y_m=100", "carrier.length_m=60",
                       "carrier.turn_interval_s=10")
    for late_s, status in ((0.02, "complete"), (0.1, "untrusted")):
        recording = rewritten(folder / f"late{late_s}.mcap", longer, behind({"/lidar_2": late_s}))
        outcome = map_recording(recording, folder / f"run{late_s}", *BOTH)
        assert outcome.run["status"] == status, (late_s, outcome.run["status"], outcome.said)
        warning = outcome.warnings["lidars.clock"]["message"]
        assert "the clock of lidar 2 seems to be" in warning and "ms late" in warning, warning
        assert abs(outcome.run["evidence"]["further_lidar_late_s"] / late_s - 1) < 0.4, outcome.run["evidence"]
        said.append(warning)
    assert "beside those of the first one" in outcome.said, outcome.said
    return said[0]


@cases.case("one whose points are in millimetres is named: partial")
def millimetres(folder):
    def scale(cloud):
        values = array.array("f", bytes(cloud.points))
        for name in ("x", "y", "z"):
            each = slice(cloud.fields[name][0] // 4, None, cloud.step // 4)
            values[each] = array.array("f", [1000 * value for value in values[each]])
        cloud.points = bytearray(values.tobytes())

    spoilt = folder / "mm.mcap"
    rewritten(spoilt, WALK, lambda m: edit_cloud(m, scale) if m.topic == "/lidar_2" else m)
    outcome = map_recording(spoilt, folder / "run", *BOTH)
    assert outcome.code == 4 and outcome.run["status"] == "partial", (outcome.code, outcome.run["status"])
    warning = outcome.warnings["recording.silent_lidar"]
    assert warning["count"] == 1 and "/lidar_2" in warning["message"], warning
    assert "millimetres" in warning["message"], warning
    return warning["message"]


@cases.case("places that lack or contradict are refused by the name of the lidar")
def places(folder):
    rig = folder / "rig.yaml"
    one = "body_frame: other\nlidars:\n- {topic: /lidar, body_from_lidar: {translation_m: [1, 0, 1]}}\n"
    for text, options, code, said in (
            (one + "- {topic: /lidar_2}\n", (), 2, "nothing tells where the lidar sits"),
            (one, BOTH, 2, "expected an entry with topic /lidar_2"),
            ("body_from_lidar: {translation_m: [1, 0, 1]}\n", BOTH, 2, "each of several lidars under `lidars`"),
            ("lidars: [{topic: /lidar}, {topic: /lidar}]\n", (), 2, "named twice"),
            ("lidars: [{topic: /lidar}, {topic: /nothing}]\n", (), 3, "/nothing")):
        rig.write_text(text)
        done = program("map", WALK, "-o", folder / "run", "--extrinsics", rig, *options)
        assert done.returncode == code and said in done.stderr, (text, done)
        assert not (folder / "run").exists()
    return "five"


@cases.case("the clocks of two lidars are found and taken out")
def clocks(folder):
    recording = rewritten(folder / "clocks.mcap", WALK, behind({"/lidar": 0.03, "/lidar_2": -0.03}))
    done = program("calibrate", "lidars", recording, *BOTH, "-o", folder / "rig")
    found = json.loads((folder / "rig" / "calibration.json").read_text())
    unsure = [lidar["topic"] for lidar in found["lidars"] if lidar["sd_s"] > 1e-3]
    assert unsure, "the recording is so short that no clock can be sure"
    assert done.returncode == 4 and found["status"] == "partial", done.stderr
    for topic in unsure:
        assert f"{topic}: its clock is known to" in done.stderr, done.stderr
    late = {lidar["topic"]: lidar["late_s"] for lidar in found["lidars"]}
    assert abs(late["/lidar"] - 0.03) < 0.01 and abs(late["/lidar_2"] + 0.03) < 0.01, late
    again = program("calibrate", "lidars", recording, "--extrinsics", folder / "rig" / "extrinsics.yaml",
                    "-o", folder / "again")
    assert again.returncode in (0, 4), again.stderr
    second = json.loads((folder / "again" / "calibration.json").read_text())
    for lidar in second["lidars"]:
        assert abs(lidar["late_s"] - late[lidar["topic"]]) < 1e-3, (late, second)
    none = program("calibrate", "lidars", recording, "-o", folder / "none")
    assert none.returncode == 2 and "expected the lidars" in none.stderr, none
    return str(late)


cases.run()
