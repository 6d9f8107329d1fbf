"""Wrong positions by satellites in the matches of `map` (`gnss.match.use`): a receiver that drifts, one that fails, a
heading that nothing mends. The path stays as good as without them, and a word is said."""

import dataclasses
import json
import math
import struct
from random import Random

from program import GOOD_SKY, HALF_THE_SCANS, SMALL_STAND, Cases, program, rewritten, simulated
from recordings import edit_fix

cases = Cases()
SECONDS = 45
DRIFT_FROM_S, DRIFT_UNTIL_S = 25.0, 35.0
WALK = simulated("demo", 8, SECONDS, "lidar.model=VLP-16", *HALF_THE_SCANS, *GOOD_SKY, "stand.trees_per_ha=400",
                 "mag.enabled=true")
TRUTH = WALK.with_suffix(".truth")


def mapped(folder, recording, *settings):
    words = [word for setting in ("map.enabled=false", *settings) for word in ("--set", setting)]
    done = program("map", recording, "-o", folder, *words)
    assert done.returncode in (0, 4), done.stderr
    return json.loads((folder / "run.json").read_text())


def error_m(run):
    done = program("evaluate", run, TRUTH, "--align", "yaw", "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["ape_rmse_m"]


def path(run):
    return (run / "trajectory.tum").read_bytes()


def warned(facts):
    return {warning["key"] for warning in facts["warnings"]}


def moved(message, east_m=0.0, north_m=0.0, up_m=0.0):
    """The fix elsewhere, by metres; other messages of the receiver say how good it is."""
    def change(latitude, longitude, height, variances):
        return (latitude + north_m / 111_450.0, longitude + east_m / (111_600.0 * math.cos(math.radians(latitude))),
                height + up_m, variances)
    return edit_fix(message, change) if message.topic == "/gnss" else message


def spoilt(folder, change):
    """The walk with change(seconds, message of the receiver), which may be nothing."""
    first = []

    def one(message):
        first.append(message.time)
        if not message.topic.startswith("/gnss"):
            return message
        return change((message.time - first[0]) / 1e9, message)
    return rewritten(folder / "spoilt.mcap", WALK, one)


def drift(seconds):
    return min(1.0, max(0.0, (seconds - DRIFT_FROM_S) / (DRIFT_UNTIL_S - DRIFT_FROM_S)))


NONE = cases.folder / "none"
mapped(NONE, WALK)
BARE = error_m(NONE)
PENALTY = cases.folder / "penalty"
GOOD = mapped(PENALTY, WALK, "gnss.match.use=penalty")


@cases.case("good positions are used, and nothing is said")
def good(folder):
    assert GOOD["counts"]["scans_by_satellites"] > 0.3 * GOOD["scans"], GOOD["counts"]
    assert not {key for key in warned(GOOD) if key.startswith("gnss")}, GOOD["warnings"]
    assert GOOD["quality"]["gnss_match_off_m"] == 0.0, GOOD["quality"]
    assert error_m(PENALTY) < BARE + 0.02, (error_m(PENALTY), BARE)
    return f"{100 * error_m(PENALTY):.1f} cm, without them {100 * BARE:.1f} cm"


def drifting(name, **metres):
    @cases.case(f"a receiver that drifts by 3 m {name} and says centimetres")
    def case(folder):
        recording = spoilt(folder, lambda seconds, message: moved(
            message, **{axis: drift(seconds) * by for axis, by in metres.items()}))
        facts = mapped(folder / "run", recording, "gnss.match.use=penalty")
        error = error_m(folder / "run")
        assert "gnss.drift" in warned(facts), facts["warnings"]
        assert 2.0 < facts["quality"]["gnss_match_off_m"] < 3.5, facts["quality"]["gnss_match_off_m"]
        assert error < BARE + 0.05, (error, BARE)
        return f"{100 * error:.1f} cm, without them {100 * BARE:.1f} cm"


drifting("sideways", east_m=2.0, north_m=-2.2)
drifting("upwards", up_m=3.0)


@cases.case("errors of 3 m that are stated as centimetres")
def overconfident(folder):
    random = Random(5)

    def change(seconds, message):
        return moved(message, random.gauss(0, 3), random.gauss(0, 3), random.gauss(0, 3))
    facts = mapped(folder / "run", spoilt(folder, change), "gnss.match.use=penalty")
    error = error_m(folder / "run")
    assert error < BARE + 0.05, (error, BARE)
    assert warned(facts) & {"gnss.not_aligned", "gnss.drift"}, facts["warnings"]
    return f"{100 * error:.1f} cm"


@cases.case("no position in the whole run")
def outage(folder):
    facts = mapped(folder / "run", spoilt(folder, lambda seconds, message: None), "gnss.match.use=penalty")
    assert "gnss.not_aligned" in warned(facts), facts["warnings"]
    assert path(folder / "run") == path(NONE), "the path is another one"
    return "the path is that without positions"


@cases.case("positions end in the middle")
def ends(folder):
    recording = spoilt(folder, lambda seconds, message: message if seconds < DRIFT_FROM_S else None)
    mapped(folder / "run", recording, "gnss.match.use=penalty")
    error = error_m(folder / "run")
    assert error < BARE + 0.03, (error, BARE)
    return f"{100 * error:.1f} cm"


@cases.case("a magnetometer beside steel")
def steel(folder):
    def one(message):
        if message.topic != "/mag":
            return message
        field = bytearray(message.data)
        struct.pack_into("<3d", field, len(field) - 12 * 8, 3e-4, -2e-4, 1e-4)
        return dataclasses.replace(message, data=bytes(field))
    recording = rewritten(folder / "spoilt.mcap", WALK, one)
    assert recording.read_bytes() != WALK.read_bytes()
    mapped(folder / "run", recording, "gnss.match.use=penalty")
    assert path(folder / "run") == path(PENALTY), "the path is another one"
    return "the path is the same"


@cases.case("a heading that nothing tells: the carrier stands, and there is one antenna")
def stands(folder):
    still = simulated("demo", 8, 12, "lidar.model=VLP-16", *GOOD_SKY, "carrier.still_s=12", *SMALL_STAND)
    facts = mapped(folder / "run", still, "gnss.match.use=penalty")
    mapped(folder / "none", still)
    assert facts["counts"].get("scans_by_satellites", 0) == 0, facts["counts"]
    assert "gnss.not_aligned" in warned(facts), facts["warnings"]
    assert path(folder / "run") == path(folder / "none"), "the path is another one"
    return "nothing pulls"


cases.run()
