"""RKO-LIO: `rko_lio_peer.py REC.mcap OUT.tum OUT.json THREADS`.

Its authors' defaults; the least range is that of the simulated lidars. A scan is handed over once
the IMU covers its end. It takes as many threads as it likes; the process is pinned to the same
processors as the others.
"""

import sys
from importlib.metadata import version

import numpy as np
import recording
from measure import Meter, report
from rko_lio.lio import LIO, LIOConfig


def main(path, trajectory, summary, threads):
    rates = recording.rates(path)
    period_ns = int(1e9 / rates["lidar"])
    rings = next(recording.scans(path)).rings.max() + 1
    odometry = LIO(LIOConfig(deskew=True, min_range=0.5, max_num_threads=int(threads),
                             double_downsample=bool(rings > 32)))  # as its authors advise
    imu_from_lidar, identity = recording.imu_from_lidar(path), np.eye(4)
    held, stamps, poses, meter = [], [], [], Meter()

    def feed(scan):
        with meter:
            odometry.register_scan(scan.points, scan.stamp_ns + scan.offsets_ns, imu_from_lidar)
        stamps.append(scan.stamp_ns)

    for event in recording.events(path):
        if not isinstance(event, recording.Imu):
            held.append(event)
            continue
        odometry.add_imu_measurement(np.array(event.accel), np.array(event.gyro), event.stamp_ns,
                                     identity)
        while held and event.stamp_ns >= held[0].stamp_ns + period_ns:
            feed(held.pop(0))
    # Its poses are those at the end of the scans.
    times, found = odometry.poses_with_timestamps()
    imu_from_body = recording.imu_from_body(path)
    found = [(int(t), recording.pose_of(p[3:], p[:3]) @ imu_from_body)
             for t, p in zip(times, found)]
    for stamp in stamps:
        j = int(np.searchsorted([t for t, _ in found], stamp))
        if 0 < j < len(found) and found[j][0] - found[j - 1][0] <= 2 * period_ns:
            u = (stamp - found[j - 1][0]) / (found[j][0] - found[j - 1][0])
            poses.append((stamp, recording.interpolated(found[j - 1][1], found[j][1], u)))
    recording.write_tum(trajectory, poses)
    report(summary, meter.summary(name="RKO-LIO", version=version("rko_lio"),
                                  answered=len(poses) / max(1, len(stamps))))


if __name__ == "__main__":
    main(*sys.argv[1:])
