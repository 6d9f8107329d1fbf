"""`understory calibrate` on good recordings and on such as tell nothing: exit codes, files, and what is said."""

import csv
import dataclasses
import json
import math
import struct

from program import Cases, program, rewritten, simulated, snapshot

cases = Cases()
STILL = "sim:still?imu_preset=vectornav&imu.rate_hz=20&seed=4"


@cases.case("an IMU that stands for hours has all figures")
def still(folder):
    noise = folder / "noise"
    done = program("calibrate", "imu", f"{STILL}&duration_s=30000", "-o", noise)
    assert done.returncode in (0, 4), done
    assert sorted(path.name for path in noise.iterdir()) == [
        "allan.csv", "imu.yaml", "imu_noise.csv", "imu_noise.html"]
    rows = list(csv.DictReader((noise / "imu_noise.csv").open()))
    assert len(rows) == 18, rows
    white = [float(r["value"]) for r in rows if r["sensor"] == "gyroscope" and r["figure"] == "white_noise"]
    assert all(abs(value / 5.55e-5 - 1) < 0.02 for value in white), white  # allan-vectornav.txt
    done = program("map", "--config", noise / "imu.yaml", "--print-config")
    assert done.returncode == 0 and "set by" in done.stdout, done
    return "files"


@cases.case("a few minutes have the white noise alone")
def minutes(folder):
    done = program("calibrate", "imu", f"{STILL}&duration_s=120", "-o", folder / "noise")
    assert done.returncode == 4, done
    assert "the bias instability on x, y, z does not stand out in 120 s" in done.stderr, done.stderr
    assert "bias_walk" not in (folder / "noise" / "imu.yaml").read_text()
    return done.stderr


@cases.case("motion and short recordings are refused, and nothing is written")
def refusals(folder):
    walk = simulated("demo", 1, 12, "lidar.model=VLP-16", "carrier.still_s=6", "stand.size_x_m=30", "stand.size_y_m=30",
                     "gnss.enabled=false")
    before = snapshot(folder)
    for more, said in (((), "it stood from 0.0 s to 6"), (("--to-s", "5"), "at least 60 s of standing"),
                       (("--from-s", "100"), "expected samples of an IMU")):
        done = program("calibrate", "imu", walk, "-o", folder / "noise", *more)
        assert done.returncode == 3 and said in done.stderr and not done.stdout, done
    assert program("calibrate", "imu", walk, "-o", folder / "noise", "--from-s", "9", "--to-s", "3").returncode == 2
    assert program("calibrate").returncode == 2
    assert snapshot(folder) == before
    return "nothing"


TRUE_PLACE, TRUE_LATE_S = (0.0, 0.0, -0.06), 0.02  # of the IMU on the lidar of that walk
WALK = simulated("demo", 1, 20, "lidar.model=VLP-16", "carrier.still_s=1", "carrier.turn_interval_s=3",
                 "stand.size_x_m=60", "stand.size_y_m=60", f"imu.time_offset_s={TRUE_LATE_S}", "gnss.enabled=false")


def calibrated(recording, rig):
    """What calibrate says, what it writes, and the errors of the place (m) and of the lateness (s)."""
    done = program("calibrate", "lidar-imu", recording, "-o", rig)
    assert done.returncode in (0, 4), done
    found = json.loads((rig / "calibration.json").read_text())
    return done, found, math.dist(found["lidar_from_imu"]["translation_m"], TRUE_PLACE), found["imu_late_s"] - TRUE_LATE_S


@cases.case("an IMU is found on the lidar of a walk")
def lidar_imu(folder):
    rig = folder / "rig"
    before = snapshot(folder)
    done = program("calibrate", "lidar-imu", WALK, "-o", rig, "--path", WALK)
    assert done.returncode == 3, done  # no trajectory
    assert snapshot(folder) == before
    done, found, away_m, late_s = calibrated(WALK, rig)
    assert sorted(path.name for path in rig.iterdir()) == ["calibration.json", "extrinsics.yaml", "path.tum"]
    # The path of the lidar alone is off by 4 cm and 0.5 ms.
    assert done.returncode == 0 and away_m < 0.01 and abs(late_s) < 0.0003, (found, away_m, late_s)
    for said in ("place of the IMU in the lidar's frame", " ms later than the lidar's", "The given extrinsics differ",
                 f"Map with it: --extrinsics {rig / 'extrinsics.yaml'}"):
        assert said in done.stdout, (said, done.stdout)
    assert len(found["covariance"]) == 7 and found["covariance"][6][6] < 0.0003 ** 2, found
    assert program("info", WALK, "--extrinsics", rig / "extrinsics.yaml").returncode == 0
    # With what was found taken out, the rest of the lateness is next to nothing.
    again = folder / "again"
    done_again = program("calibrate", "lidar-imu", WALK, "-o", again, "--extrinsics", rig / "extrinsics.yaml")
    assert done_again.returncode in (0, 4), done_again
    rest = json.loads((again / "calibration.json").read_text())["imu_late_s"]
    assert abs(rest) < 0.002, rest
    late = [float(line.split()[1]) for path in (rig, again) for line in (path / "extrinsics.yaml").read_text().splitlines()
            if line.startswith("late_s")]
    assert abs(late[0] + found["imu_late_s"]) < 1e-6 and abs(late[1] - late[0] + rest) < 2e-6, (late, rest)
    return done.stdout


@cases.case("an IMU is found as well where nothing tells its place")
def lidar_imu_of_no_place(folder):
    walk = rewritten(folder / "bare.mcap", WALK, lambda m: m if m.topic != "/tf_static" else None)
    done, found, away_m, late_s = calibrated(walk, folder / "rig")
    assert done.returncode == 0 and away_m < 0.01 and abs(late_s) < 0.0003, (found, away_m, late_s)
    return f"{100 * away_m:.1f} cm"


def clipped(message, most=10.5):
    if message.topic != "/imu":
        return message
    data, where = bytearray(message.data), len(message.data) - 96  # before the last covariance
    axes = struct.unpack_from("<3d", data, where)
    struct.pack_into("<3d", data, where, *(max(-most, min(most, value)) for value in axes))
    return dataclasses.replace(message, data=bytes(data))


@cases.case("an accelerometer that clips is told, and counts less")
def clipped_imu(folder):
    walk = rewritten(folder / "clipped.mcap", WALK, clipped)
    done, found, away_m, _ = calibrated(walk, folder / "rig")
    assert done.returncode == 4 and "rest on the path of the lidar alone" in done.stderr, done
    sd_m = math.sqrt(sum(found["covariance"][i][i] for i in range(3, 6)))
    assert 0.02 < sd_m and away_m < 3 * sd_m, (away_m, sd_m)
    return f"{100 * away_m:.1f} cm, stated {100 * sd_m:.1f} cm"


@cases.case("a machine that drives calmly for seconds tells its IMU only roughly")
def calm_lidar_imu(folder):
    drive = simulated("harvester", 5, 12.5, "lidar.model=VLP-16", "gnss.enabled=false", "stand.size_x_m=80", "stand.size_y_m=60")
    done = program("calibrate", "lidar-imu", drive, "-o", folder / "rig")
    assert done.returncode == 4 and "Record a minute" in done.stderr, done
    assert "only roughly known are" in done.stderr, done
    return done.stderr


@cases.case("what tells nothing of lidar and IMU is refused")
def no_lidar_imu(folder):
    for recording, said in ((f"{STILL}&duration_s=20", "lidar"),
                            ("sim:demo?lidar.model=VLP-16&duration_s=4&gnss.enabled=false&stand.size_x_m=30"
                             "&stand.size_y_m=30", "at least 10 s of a path")):
        done = program("calibrate", "lidar-imu", recording, "-o", folder / "rig")
        assert done.returncode == 3 and said in done.stderr and not done.stdout, done
    assert not list(folder.iterdir())


cases.run()
