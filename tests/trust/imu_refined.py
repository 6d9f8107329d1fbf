"""`map --refine-imu` finds a clock that is 20 ms late and maps with it. A good IMU leaves the run as it is. By stems the
late clock is told."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import PROGRAM, Cases, program, simulated, unpacked
from recordings import late_imu, read_mcap, write_mcap

PATH_ALONE = ("--set", "map.enabled=false")
cases = Cases()


WALK = simulated("handheld", 4, 42, "lidar.model=VLP-16", "stand.trees_per_ha=300")
MESSAGES = read_mcap(unpacked(WALK))


def walked(folder, offset_s, seconds=25):
    write_mcap(folder / "walk.mcap", late_imu(MESSAGES, offset_s, seconds))
    return folder / "walk.mcap"


def mapped(recording, folder, *more):
    done = program("map", recording, "-o", folder, *more)
    assert done.returncode in (0, 4), done.stderr
    facts = json.loads((folder / "run.json").read_text())
    return facts, {w["key"]: w["message"] for w in facts["warnings"]}


def error_m(folder):
    done = program("evaluate", folder, WALK.with_suffix(".truth"), "--align", "se3", "--json")
    return json.loads(done.stdout)["ape_rmse_m"]


@cases.case("20 ms are found and taken out, also after the run was cut off")
def late(folder):
    recording, plain, run, cut = walked(folder, 0.02), folder / "plain", folder / "run", folder / "cut"
    mapped(recording, plain, *PATH_ALONE)
    facts, warnings = mapped(recording, run, "--refine-imu", *PATH_ALONE)
    found = facts["imu_calibration"]
    assert abs(found["imu_late_s"] - 0.02) < 1e-3 and abs(found["used_imu_late_s"] - 0.02) < 1e-3, found
    assert 1 <= found["begun_anew"] <= 3 and len(found["covariance"]) == len(found["covariance"][0]) == 7, found
    assert 0 < found["covariance"][6][6] < 1e-6, found
    assert "imu.clock" not in warnings, warnings
    assert "Place and clock of the IMU" in (run / "report.html").read_text()
    before, after = error_m(plain), error_m(run)
    assert after < 0.6 * before, (before, after)
    work = subprocess.Popen([PROGRAM, "--quiet", "map", recording, "-o", cut, "--refine-imu", *PATH_ALONE],
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 300
    grown = shrunk = False
    while time.monotonic() < deadline and work.poll() is None:
        sizes = [path.stat().st_size for path in cut.rglob("journal.bin")]
        shrunk = shrunk or (grown and bool(sizes) and sizes[0] < 30_000)
        grown = grown or any(size > 50_000 for size in sizes)
        if shrunk and any(size > 30_000 for size in sizes):
            break
        time.sleep(0.005)
    work.send_signal(signal.SIGKILL)
    assert work.wait() == -signal.SIGKILL, "the run had ended before it could be killed"
    resumed = program("map", "--resume", cut)
    assert resumed.returncode in (0, 4), resumed.stderr
    assert (cut / "trajectory.tum").read_bytes() == (run / "trajectory.tum").read_bytes()
    assert json.loads((cut / "run.json").read_text())["imu_calibration"] == found
    return f"{1e3 * found['imu_late_s']:.2f} ms, {1e3 * before:.1f} to {1e3 * after:.1f} mm"


@cases.case("a good IMU leaves the run as it is")
def good(folder):
    recording, plain, run = walked(folder, 0.0), folder / "plain", folder / "run"
    mapped(recording, plain, *PATH_ALONE)
    facts, _ = mapped(recording, run, "--refine-imu", *PATH_ALONE)
    assert facts["imu_calibration"]["begun_anew"] == 0, facts["imu_calibration"]
    assert (plain / "trajectory.tum").read_bytes() == (run / "trajectory.tum").read_bytes()


@cases.case("what cannot be refined is said, and nothing is lost")
def refused(folder):
    recording = walked(folder, 0.0, seconds=6)
    for more, why in ((("--front-end", "sparse"), "--refine-imu"), (("--set", "motion.imu_enabled=false"), "refine_imu")):
        done = program("map", recording, "-o", folder / "none", "--refine-imu", *more)
        assert done.returncode == 2 and why in done.stderr and not (folder / "none").exists(), done.stderr
    facts, warnings = mapped(recording, folder / "short", "--refine-imu", *PATH_ALONE)
    assert "imu.not_refined" in warnings and "imu_calibration" not in facts, warnings
    assert facts["poses"] > 50


@cases.case("by stems 20 ms are told, and a good clock is not spoken of")
def by_stems(folder):
    for offset_s, told in ((0.02, True), (0.0, False)):
        place = folder / str(offset_s)
        place.mkdir()
        facts, warnings = mapped(walked(place, offset_s, seconds=42), place / "run", "--front-end", "sparse")
        assert ("imu.clock" in warnings) == told, warnings
        assert abs(facts["quality"]["imu_late_ms"] - 1e3 * offset_s) < 8, facts["quality"]
        assert "imu_turned_deg" not in facts["quality"]


cases.run()
