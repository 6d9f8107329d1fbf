"""GenZ-LIO, a program of its own (GPL-2.0): `genz_lio_peer.py REC.mcap OUT.tum OUT.json THREADS`.

Its authors' defaults for the kind of lidar (Ouster with over 32 rings, else Velodyne), with the recording's
rings, rate and extrinsics. Its poses are the IMU's at the times that it tells.
"""

import sys
from importlib.metadata import version
from pathlib import Path

import genz_lio
import inertial_feed
import numpy as np
import recording
from measure import Meter, report


def settings(path, threads):
    rings = int(next(recording.scans(path)).rings.max()) + 1
    rings = 16 if rings <= 16 else 32 if rings <= 32 else 128
    kind = "ouster" if rings > 32 else "velodyne"
    config = genz_lio.load_config(Path(genz_lio.__file__).parent / "configs" / "default" / f"{kind}.yaml")
    config.max_threads = int(threads)
    config.preprocess.scan_line = rings
    config.preprocess.scan_rate = round(recording.rates(path)["lidar"])
    config.preprocess.blind_min = 0.5  # as of the simulated lidars
    transform = recording.imu_from_lidar(path)
    config.mapping.extrinsic_t, config.mapping.extrinsic_r = transform[:3, 3], transform[:3, :3]
    return config


def main(path, trajectory, summary, threads):
    odometry = genz_lio.GenZLIO(settings(path, threads))
    imu_from_body = recording.imu_from_body(path)
    meter, stamps, found = Meter(), [], []
    for scan, imu, begin, start in inertial_feed.frames(path):
        offsets = 1e-9 * scan.offsets_ns
        with meter:
            result = odometry.register_scan(scan.points, begin, begin + offsets.max(), imu, timestamps=offsets,
                                            intensities=scan.intensity, rings=scan.rings, timing_prepared=True)
        stamps.append(scan.stamp_ns)
        if result.valid:
            found.append((start + round(1e9 * result.timestamp), np.array(result.pose) @ imu_from_body))
    poses = inertial_feed.at_stamps(found, stamps, 2e9 / recording.rates(path)["lidar"])
    recording.write_tum(trajectory, poses)
    report(summary, meter.summary(name="GenZ-LIO", version=version("genz-lio"),
                                  answered=len(poses) / max(1, len(stamps))))


if __name__ == "__main__":
    main(*sys.argv[1:])
