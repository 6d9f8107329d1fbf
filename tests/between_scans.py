"""Poses between scans. `map --imu-rate` writes one for each sample of the IMU, predicted from what was
known then. `scan_fraction` writes one for each part of a scan."""

import json
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent / "bad_input"))
from program import Cases, program, simulated

cases = Cases()
SHORT = simulated("harvester", 5, 14)


def poses(file):
    """Rows of a TUM file: time, then place and attitude."""
    rows = [[float(cell) for cell in line.split()] for line in file.read_text().splitlines() if not line.startswith("#")]
    return {row[0]: row[1:] for row in rows}


def mapped(run, *more):
    done = program("map", SHORT, "-o", run, *more)
    assert done.returncode in (0, 4), done.stderr
    return run


PLAIN = mapped(cases.folder / "plain")
PREDICTED = mapped(cases.folder / "predicted", "--imu-rate")


@cases.case("a prediction for each sample of the IMU, and no other file changes")
def each_sample(folder):
    run = PREDICTED
    assert not (PLAIN / "trajectory_imu.tum").exists()
    for name in ("trajectory.tum", "map.laz", "trees.csv"):
        assert (run / name).read_bytes() == (PLAIN / name).read_bytes(), f"{name} differs"
    scans, predicted = poses(run / "trajectory.tum"), poses(run / "trajectory_imu.tum")
    counts = json.loads((run / "run.json").read_text())["counts"]
    assert counts["imu_predictions"] == len(predicted) and counts["imu_predictions_coasted"] == 0, counts
    times = list(predicted)
    steps = [b - a for a, b in zip(times, times[1:])]
    assert min(steps) > 0.0 and max(steps) < 0.0051, "not one for each sample of 200 Hz"
    assert 0.0 < times[0] - min(scans) < 0.12 and len(times) > 0.97 * counts["imu_samples"], len(times)
    # A prediction looks a fifth of a second ahead: it lies near the scan that comes later.
    far = [math.dist(predicted[min(times, key=lambda time: abs(time - scan))][:3], scans[scan][:3])
           for scan in scans if scan > times[0] + 1.0]
    assert 1e-5 < max(far) < 0.05, f"a prediction is {max(far):.6f} m from the scan that comes later"


@cases.case("edges of the graph know what each match told, not the length of the way alone")
def edges(folder):
    unequal = 0
    lines = [line.split() for line in (PLAIN / "graph.g2o").read_text().splitlines() if line.startswith("EDGE_SE3")]
    for line in lines:
        information = [float(cell) for cell in line[10:]]  # upper triangle, translation first
        xx, yy, zz = information[0], information[6], information[11]
        unequal += max(xx, yy, zz) > 1.0001 * min(xx, yy, zz)
    assert len(lines) > 10 and unequal > 0.8 * len(lines), f"{unequal} of {len(lines)} edges differ by direction"


@cases.case("quarters of scans give four poses a scan, and no other file changes")
def quarters(folder):
    run = mapped(folder / "parts", "--set", "scan_fraction=0.25")
    assert not (PLAIN / "trajectory_partial.tum").exists()
    for name in ("trajectory.tum", "map.laz", "trees.csv"):
        assert (run / name).read_bytes() == (PLAIN / name).read_bytes(), f"{name} differs"
    scans, parts = poses(run / "trajectory.tum"), poses(run / "trajectory_partial.tum")
    facts = json.loads((run / "run.json").read_text())
    counts, quality = facts["counts"], facts["quality"]
    # The first scan has no map before it.
    assert len(parts) == 4 * (len(scans) - 1) == counts["scan_parts"], (len(parts), len(scans))
    assert counts["scan_parts_matched"] > 0.9 * len(parts), counts
    times = list(parts)
    assert times == sorted(times) and set(times[::4]) <= set(scans), "a first part begins where its scan does"
    # A part is matched from where the scan before says; its scan lies in the same map.
    far = [math.dist(parts[time][:3], scans[time][:3]) for time in times[::4]]
    assert 1e-5 < max(far) < 0.1 and sum(far) / len(far) < 0.02, (max(far), sum(far) / len(far))
    assert 0.0 < quality["partial_latency_ms"] < quality["scan_latency_ms"], quality


@cases.case("a run that is moved moves its predictions")
def moved(folder):
    run, to, fixes = PREDICTED, folder / "moved", folder / "fixes.csv"
    scans = poses(run / "trajectory.tum")
    fixes.write_text("timestamp,latitude_deg,longitude_deg,height_m\n" + "".join(
        f"{time},{62 + place[1] / 111e3:.9f},{29 + place[0] / 52e3:.9f},100\n" for time, place in scans.items()))
    done = program("georeference", run, "-o", to, "--gnss", fixes, "--method", "gnss-path")
    assert done.returncode in (0, 4), done.stderr
    before, after = poses(run / "trajectory_imu.tum"), poses(to / "trajectory_imu.tum")
    scans_after = poses(to / "trajectory.tum")
    assert list(before) == list(after)
    for prediction, scan in zip(list(before)[::100], list(scans)[::10]):
        assert math.isclose(math.dist(before[prediction][:3], scans[scan][:3]),
                            math.dist(after[prediction][:3], scans_after[scan][:3]), abs_tol=1e-6)


@cases.case("without an IMU nothing is mapped, and the message says why")
def no_imu(folder):
    silent = program("map", "sim:harvester?seed=5&duration_s=2&imu.enabled=false", "-o", folder / "none", "--imu-rate")
    assert silent.returncode == 3 and "expected an IMU" in silent.stderr, silent.stderr
    for more in (["--front-end", "sparse"], ["--set", "motion.imu_enabled=false"]):
        refused = program("map", SHORT, "-o", folder / "none", "--imu-rate", *more)
        assert refused.returncode == 2 and "imu" in refused.stderr, refused.stderr
    assert not (folder / "none").exists()


cases.run()
