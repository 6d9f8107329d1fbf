"""Pelorus: `pelorus_peer.py REC.mcap OUT.tum OUT.json THREADS`.

Its authors' defaults, but for the recording's extrinsics and the least range of the simulated lidars
(its own is 4 m). One scan, not three, begins the map, as the carrier may move at once. It works in
threads of its own. A scan is handed over once the IMU covers its end, and the next one when it has
answered. Its poses are the lidar's.
"""

import os
import sys
import time
from importlib.metadata import version
from pathlib import Path

import inertial_feed
import numpy as np
import recording
from measure import Meter, report

WAIT_S = 5.0  # for an answer


def settings(path):
    transform = recording.imu_from_lidar(path)
    rows = ", ".join("[" + ", ".join(f"{v:.9f}" for v in row) + "]" for row in transform[:3, :3])
    place = ", ".join(f"{1000 * v:.4f}mm" for v in transform[:3, 3])
    return (f"preprocessing.filter.distance.range = 0.5m..\n"
            f"preprocessing.initial_scan_accumulate = 1\n"
            f"lidar.vendor = Ouster\n"
            f"imu.from_lidar_transform.translation = [{place}]\n"
            f"imu.from_lidar_transform.rotation = [{rows}]\n"
            f"output.terminal.ui = false\n")


def seconds(stamp_ns):
    return {"timestamp_sec": stamp_ns // 10**9, "timestamp_nanosec": stamp_ns % 10**9}


def answer_of(handle, deadline):
    while time.perf_counter() < deadline:
        found = handle.try_recv()
        if found is not None:
            return found
        time.sleep(0.0005)
    return None


def pose_of(found):
    w, x, y, z = found["orientation"]
    return recording.pose_of((x, y, z, w), found["position"])


def main(path, trajectory, summary, threads):
    os.environ["RAYON_NUM_THREADS"] = threads
    import pelorus
    config = Path(trajectory).with_suffix(".rl")
    config.write_text(settings(path))
    handle = pelorus.Handle(str(config))
    lidar_from_body = recording.lidar_from_body(path)
    meter, stamps, found = Meter(), [], []
    none, unknown = [0.0] * 9, [-1.0] + [0.0] * 8
    for scan, imu, begin, start in inertial_feed.frames(path):
        for row in imu:
            handle.add_imu(**seconds(start + round(1e9 * row[0])), orientation=[1.0, 0.0, 0.0, 0.0],
                           orientation_covariance=unknown, angular_velocity=list(row[4:7]),
                           angular_velocity_covariance=none, linear_acceleration=list(row[1:4]),
                           linear_acceleration_covariance=none)
        points = np.column_stack([scan.points, scan.intensity, scan.offsets_ns.astype(np.float64)])
        with meter:
            handle.add_pointcloud(points, **seconds(scan.stamp_ns))
            answer = answer_of(handle, time.perf_counter() + (WAIT_S if found else 0.5))
        stamps.append(scan.stamp_ns)
        if answer is not None:
            stamp = answer["timestamp_sec"] * 10**9 + answer["timestamp_nanosec"]
            found.append((stamp, pose_of(answer) @ lidar_from_body))
    poses = inertial_feed.at_stamps(found, stamps, 2e9 / recording.rates(path)["lidar"])
    recording.write_tum(trajectory, poses)
    report(summary, meter.summary(name="Pelorus", version=version("pelorus"),
                                  answered=len(poses) / max(1, len(stamps))))


if __name__ == "__main__":
    main(*sys.argv[1:])
