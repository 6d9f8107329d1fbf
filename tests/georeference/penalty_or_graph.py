"""Positions as penalties of the matches, as factors of the graph, and as both, on the same recordings (P3-8). Each
way does what its name says, both go together, and none spoils a path that good fixes tell."""

import json
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import HALF_THE_SCANS, SCANS_PER_S, Cases, program, simulated

cases = Cases()
WAYS = {"none": (), "penalty": ("gnss.match.use=penalty",), "graph": ("gnss.use=fuse",),
        "both": ("gnss.match.use=penalty", "gnss.use=fuse")}
SECONDS = 30
# RTK all the way, and the receiver of the site: it errs by decimetres for a minute.
RTK = simulated("skidoo", 5, SECONDS, "gnss.canopy_sd_m=0.03", "gnss.jump_interval_s=0")
UNDER_TREES = simulated("skidoo", 5, SECONDS, *HALF_THE_SCANS)
TWO_ANTENNAS = simulated("skidoo", 5, SECONDS, *HALF_THE_SCANS, "gnss.second_antenna_m=[0.9,0,0]", "gnss.heading_sd_deg=0.2")


def mapped(recording, folder, *settings):
    words = [word for setting in ("map.enabled=false", "loop_closure.enabled=false", *settings)
             for word in ("--set", setting)]
    done = program("map", recording, "-o", folder, *words)
    assert done.returncode in (0, 4), done.stderr
    return json.loads((folder / "run.json").read_text())


def errors(recording, run):
    done = program("evaluate", run, recording.with_suffix(".truth"), "--align", "yaw", "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


FOLDERS = {way: cases.folder / f"rtk_{way}" for way in WAYS}
TOLD = {way: mapped(RTK, FOLDERS[way], *WAYS[way]) for way in WAYS}
PENALTY = cases.folder / "under_trees_penalty"
TOLD_PENALTY = mapped(UNDER_TREES, PENALTY, *WAYS["penalty"])


@cases.case("penalties act in the matches, the graph afterwards, both in both")
def each_acts(folder):
    pulled = {way: TOLD[way]["counts"].get("scans_by_satellites", 0) for way in WAYS}
    assert pulled["none"] == pulled["graph"] == 0, pulled
    assert pulled["penalty"] == pulled["both"] > 0.3 * TOLD["both"]["scans"], pulled
    fused = {way: TOLD[way]["georeference"].get("method") == "fuse" for way in WAYS}
    assert fused == {"none": False, "penalty": False, "graph": True, "both": True}, fused
    paths = {way: (FOLDERS[way] / "trajectory.tum").read_bytes() for way in WAYS}
    assert len(set(paths.values())) == len(WAYS), "two ways gave the same path"
    return f"{pulled['both']} of {TOLD['both']['scans']} scans"


@cases.case("with good fixes no way spoils the path")
def none_spoils(folder):
    found = {way: errors(RTK, FOLDERS[way]) for way in WAYS}
    bare = found["none"]
    for way, one in found.items():
        # Fixes are good to 3 to 6 cm in the plane, and to 6 to 11 cm in height.
        assert way == "none" or one["ape_rmse_m"] < 0.7 * bare["ape_rmse_m"], (way, one["ape_rmse_m"], bare["ape_rmse_m"])
        assert one["ape_rotation_rmse_deg"] < 0.5, (way, one["ape_rotation_rmse_deg"])
        assert TOLD[way]["status"] == "complete", (way, TOLD[way])
    return ", ".join(f"{way} {100 * one['ape_rmse_m']:.1f} cm" for way, one in found.items())


@cases.case("under trees a penalty is no worse than nothing")
def under_trees(folder):
    mapped(UNDER_TREES, folder / "none")
    found = {way: errors(UNDER_TREES, run)["ape_rmse_m"] for way, run in (("none", folder / "none"), ("penalty", PENALTY))}
    assert found["penalty"] <= 1.05 * found["none"] + 0.01, found
    return ", ".join(f"{way} {100 * error:.1f} cm" for way, error in found.items())


@cases.case("a second antenna is a prior of the heading in the match, also where fixes are free")
def second_antenna(folder):
    told = {"one": TOLD_PENALTY, "two": mapped(TWO_ANTENNAS, folder / "two", *WAYS["penalty"])}
    # The first stretch ends sooner, since its heading is known while the sleigh stands.
    begins = {name: one["quality"]["gnss_match_from_s"] for name, one in told.items()}
    assert begins["two"] <= begins["one"], begins
    # Under trees most fixes say no place. The heading counts at each scan.
    share = {name: one["counts"]["scans_by_satellites"] / (one["scans"] - SCANS_PER_S * begins[name]) for name, one in told.items()}
    assert share["two"] > 0.95 > 0.8 > share["one"], share
    assert errors(TWO_ANTENNAS, folder / "two")["ape_rotation_rmse_deg"] < 0.5
    return f"{100 * share['two']:.0f} % of the scans, without {100 * share['one']:.0f} %"


cases.run()
