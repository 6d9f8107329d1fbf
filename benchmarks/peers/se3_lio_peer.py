"""SE(3)-LIO, a program of its own (GPL-2.0): `se3_lio_peer.py REC.mcap OUT.tum OUT.json THREADS`.

Its authors' defaults and the recording's extrinsics. Its poses are the IMU's at the ends of the scans.
"""

import os
import sys
from importlib.metadata import version

import inertial_feed
import numpy as np
import recording
from measure import Meter, report


def main(path, trajectory, summary, threads):
    os.environ["OMP_NUM_THREADS"] = threads
    from se3_lio import SE3LIO, SE3LIOConfig
    odometry = SE3LIO(SE3LIOConfig(), lidar_extrinsic=recording.imu_from_lidar(path))
    imu_from_body = recording.imu_from_body(path)
    meter, stamps, found = Meter(), [], []
    for scan, imu, begin, start in inertial_feed.frames(path):
        with meter:
            state, _ = odometry.register_frame(scan.points, 1e-9 * scan.offsets_ns, imu, begin)
        stamps.append(scan.stamp_ns)
        found.append((start + round(1e9 * state.stamp), np.array(state.pose) @ imu_from_body))
    poses = inertial_feed.at_stamps(found, stamps, 2e9 / recording.rates(path)["lidar"])
    recording.write_tum(trajectory, poses)
    report(summary, meter.summary(name="SE3-LIO", version=version("se3-lio"),
                                  answered=len(poses) / max(1, len(stamps))))


if __name__ == "__main__":
    main(*sys.argv[1:])
