"""`understory map` on the two short real recordings, scan to scan.

OS-1-128 capture with IMU packets: relative poses in Ouster's sensor frame agree with those of the
capture to 3 cm and 0.2 degrees. Those are a scan matcher's answer, so a peer's, not truth. Four KITTI
scans, already deskewed, without IMU, agree with small_gicp's GICP (voxels of 0.25 m) in the same run to
3 cm and 0.1 degrees. The difference from KITTI's own poses is reported. Both begin without a motion and
guess the next one from their own last one: neither knows the other's answer.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
DATA = Path(os.environ["UNDERSTORY_DATA"])
CAPTURE = DATA / "drivers" / "OS-1-128_v2.3.0_1024x10_lb_n3.pcap"
CAPTURE_POSES = DATA / "drivers" / "OS-1-128_v2.3.0_1024x10_lb_n3_poses_kitti.txt"
KITTI = DATA / "kitti00_0-3"
KITTI_PERIOD_S = 0.1037
CAMERA_FROM_LIDAR = np.array([  # README of the data
    [0.000427680, -0.999967248, -0.008084492, -0.011984599],
    [-0.007210627, 0.008081198, -0.999941316, -0.054039847],
    [0.999973865, 0.000485949, -0.007206934, -0.292196865],
    [0, 0, 0, 1]])


def read_tum(path):
    """[world_from_body]"""
    poses = []
    for line in path.read_text().splitlines():
        _, x, y, z, qx, qy, qz, qw = map(float, line.split())
        pose = np.eye(4)
        pose[:3, :3] = [
            [1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw), 2 * (qx * qz + qy * qw)],
            [2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qx * qw)],
            [2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy)]]
        pose[:3, 3] = x, y, z
        poses.append(pose)
    return poses


def read_kitti(path):
    return [np.vstack([row.reshape(3, 4), [0, 0, 0, 1]]) for row in np.loadtxt(path)]


def steps(poses):
    """The pose of each in the one before, and of the last in the first."""
    pairs = [(i, i + 1) for i in range(len(poses) - 1)] + [(0, len(poses) - 1)]
    return {pair: np.linalg.inv(poses[pair[0]]) @ poses[pair[1]] for pair in pairs}


def difference(a, b):
    """Metres and degrees between two relative poses: direction, length and rotation."""
    step = np.linalg.inv(a) @ b
    axis = [step[2, 1] - step[1, 2], step[0, 2] - step[2, 0], step[1, 0] - step[0, 1]]
    degrees = np.degrees(np.arcsin(min(1.0, np.linalg.norm(axis) / 2)))
    return np.linalg.norm(a[:3, 3] - b[:3, 3]), degrees


def compare(name, ours, theirs, max_m, max_deg):
    """How many relative poses differ by more."""
    failures = 0
    for pair, step in ours.items():
        metres, degrees = difference(step, theirs[pair])
        good = metres < max_m and degrees < max_deg
        failures += not good
        print(f"{name} {pair[0]}-{pair[1]}: {np.linalg.norm(step[:3, 3]):.3f} m, differs by "
              f"{100 * metres:.2f} cm, {degrees:.3f} deg{'' if good else '  TOO FAR'}")
    return failures


def map_recording(recording, run, *options):
    done = subprocess.run([PROGRAM, "map", str(recording), "-o", str(run), "--quiet", *options],
                          capture_output=True, text=True)
    assert done.returncode == 0, (done.returncode, done.stderr)
    return json.loads((run / "run.json").read_text())


def check_capture(folder):
    run = folder / "os1"
    said = map_recording(CAPTURE, run)
    # The IMU used to be called out of order here; the capture shows no stems.
    assert {warning["key"] for warning in said["warnings"]} == {"inventory"}, said["warnings"]
    info = json.loads(subprocess.run([PROGRAM, "info", "--json", str(CAPTURE)], check=True,
                                     capture_output=True, text=True).stdout)["rig"]
    # The body is the IMU, which is not turned against Ouster's sensor frame.
    assert info["body_frame"] == "imu" and abs(info["body_from_lidar"]["rotation_xyzw"][3]) > 1 - 1e-9
    body_from_sensor = np.eye(4)
    body_from_sensor[:3, 3] = info["body_from_lidar"]["translation_m"]
    ours = steps([pose @ body_from_sensor for pose in read_tum(run / "trajectory.tum")])
    return compare("OS-1-128", ours, steps(read_kitti(CAPTURE_POSES)), 0.03, 0.2)


def check_kitti(folder):
    import small_gicp
    files = sorted(KITTI.glob("*.bin"))
    run = folder / "kitti"
    map_recording(KITTI, run, "--rate-hz", str(1 / KITTI_PERIOD_S))
    ours = steps(read_tum(run / "trajectory.tum"))
    clouds = [np.fromfile(f, np.float32).reshape(-1, 4)[:, :3].astype(float) for f in files]
    def gicp(i, j, guess):
        return small_gicp.align(clouds[i], clouds[j], registration_type="GICP",
                                init_T_target_source=guess,
                                downsampling_resolution=0.25).T_target_source

    peer = {}
    guess = whole = np.eye(4)
    for i in range(len(clouds) - 1):
        guess = peer[i, i + 1] = gicp(i, i + 1, guess)
        whole = whole @ guess
    peer[0, len(clouds) - 1] = gicp(0, len(clouds) - 1, whole)
    failures = compare("KITTI against GICP", ours, peer, 0.03, 0.1)
    camera = read_kitti(KITTI / "poses.txt")
    lidar = [np.linalg.inv(CAMERA_FROM_LIDAR) @ pose @ CAMERA_FROM_LIDAR for pose in camera]
    # Reported, not judged: the first poses of that drive are known to be off by 10 to 20 cm.
    compare("KITTI against poses.txt", ours, steps(lidar), np.inf, np.inf)
    return failures


def main():
    what = sys.argv[1]
    needed = {"capture": CAPTURE_POSES, "kitti": KITTI / "poses.txt"}[what]
    if not needed.exists():
        print(f"skipped: {needed} is not there")
        return 77
    with tempfile.TemporaryDirectory() as folder:
        return (check_capture if what == "capture" else check_kitti)(Path(folder)) > 0


sys.exit(main())
