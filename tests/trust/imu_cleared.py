"""An IMU that is right and that the matches contradict. The recording is mapped with scans alone until
that is clear, and then again from its beginning with the IMU. A path that is not the accelerometer's is
not called complete."""

import json
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import PROGRAM, Cases, simulated

cases = Cases()

# A slow turn over even ground. Matched to small cells alone and with the machine's own returns, as here, it looks as if
# the machine stood still.
TURN = simulated("swing", 10, 12, "carrier.still_s=6.05", "carrier.first_turn_deg=-120.0",
                 "carrier.first_turn_rate_deg_s=35.0", "lidar.mount_rpy_deg=[0,26.8,0]")
MISLED = ("registration.ndt.sparse_cell_m=0", "preprocess.carried.reach_m=0")


def mapped(folder, *settings):
    words = [word for setting in ("map.enabled=false", *settings) for word in ("--set", setting)]
    done = subprocess.run([PROGRAM, "map", TURN, "-o", folder, *words], capture_output=True, text=True, timeout=300)
    return done, json.loads((folder / "run.json").read_text())


@cases.case("the recording is mapped again with an IMU that was doubted and is right")
def cleared(folder):
    done, facts = mapped(folder / "run", *MISLED)
    said = done.stderr
    doubted = said.index("started again without the IMU")
    assert said.index("the IMU is right: the recording is mapped again from its beginning") > doubted, said
    evidence = facts["evidence"]
    assert evidence["imu_used"] and evidence["imu_trusted"] and evidence["imu_doubted_s"] == 0, evidence
    assert facts["scans"] == 120 and facts["counts"]["scans_without_imu"] == 0, facts["counts"]
    # All the same the turn is matched wrongly there, and that is said.
    assert done.returncode == 4 and facts["status"] == "untrusted", facts["status"]
    assert "are not those of the accelerometer" in facts["reasons"][0], facts["reasons"]
    return facts["reasons"][0]


@cases.case("with larger cells in sparse places, and without the machine, the turn is followed")
def followed(folder):
    done, facts = mapped(folder / "run")
    assert done.returncode == 0 and facts["status"] == "complete", done.stderr
    assert not any(w["key"].startswith("imu.") for w in facts["warnings"]), facts["warnings"]
    return f"{facts['scans']} scans"


cases.run()
