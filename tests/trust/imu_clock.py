"""Every run checks the IMU's clock against the scans. 20 ms put into the stamps are told, with their
size and sign, and a good clock is not spoken of. The run is the same either way, also after it was cut
off."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import PROGRAM, Cases, program, simulated, unpacked
from recordings import late_imu, read_mcap, write_mcap

cases = Cases()
MESSAGES = read_mcap(unpacked(simulated("handheld", 4, 42, "lidar.model=VLP-16")))  # that of imu_refined.py


def walked(folder, offset_s):
    write_mcap(folder / "walk.mcap", late_imu(MESSAGES, offset_s, 25))
    return folder / "walk.mcap"


def mapped(recording, folder):
    done = program("map", recording, "-o", folder, "--set", "map.enabled=false")
    assert done.returncode in (0, 4), done.stderr
    facts = json.loads((folder / "run.json").read_text())
    return done, facts, {w["key"]: w["message"] for w in facts["warnings"]}


@cases.case("a good clock is not spoken of")
def good(folder):
    done, facts, warnings = mapped(walked(folder, 0.0), folder / "run")
    assert "imu.clock" not in warnings and "imu.axes" not in warnings, warnings
    figures = facts["quality"]
    assert abs(figures["imu_late_ms"]) < 5 and 0 < figures["imu_late_sd_ms"] < 3, figures
    return f"{figures['imu_late_ms']:.1f} ± {figures['imu_late_sd_ms']:.1f} ms"


@cases.case("20 ms are told, in the terminal, run.json and report, and after a run was cut off")
def late(folder):
    recording, run, cut = walked(folder, 0.02), folder / "run", folder / "cut"
    done, facts, warnings = mapped(recording, run)
    assert "late by that of the lidar" in warnings["imu.clock"] and "calibrate lidar-imu" in warnings["imu.clock"], warnings
    assert abs(facts["quality"]["imu_late_ms"] - 20) < 8, facts["quality"]
    assert "the clock of the IMU seems to be" in done.stderr, done.stderr
    assert "the clock of the IMU seems to be" in (run / "report.html").read_text()
    work = subprocess.Popen([PROGRAM, "--quiet", "map", recording, "-o", cut, "--set", "map.enabled=false"],
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for _ in range(6000):
        if any(path.stat().st_size > 60_000 for path in cut.rglob("journal.bin")):
            break
        time.sleep(0.01)
    work.send_signal(signal.SIGKILL)
    assert work.wait() == -signal.SIGKILL, "the run had ended before it could be killed"
    assert program("map", "--resume", cut).returncode in (0, 4)
    again = json.loads((cut / "run.json").read_text())
    for key in ("imu_late_ms", "imu_late_sd_ms", "imu_turned_deg"):
        assert facts["quality"][key] == again["quality"][key], key
    return warnings["imu.clock"]


cases.run()
