"""KISS-ICP (PyPI) on a recording: `kiss_icp_peer.py REC.mcap OUT.tum OUT.json THREADS`.

Its own defaults: deskewing on, 100 m range, voxels of 1 m. Only register_frame is timed.
"""

import sys
from importlib.metadata import version

import recording
from kiss_icp.config import KISSConfig
from kiss_icp.kiss_icp import KissICP
from measure import Meter, report


def main(path, trajectory, summary, threads):
    config = KISSConfig()
    config.mapping.voxel_size = config.data.max_range / 100.0
    config.registration.max_num_threads = int(threads)
    odometry = KissICP(config)
    lidar_from_body = recording.lidar_from_body(path)
    meter, poses = Meter(), []
    for scan in recording.scans(path):
        times = scan.offsets_ns / max(1, scan.offsets_ns.max())
        with meter:
            odometry.register_frame(scan.points, times)
        poses.append((scan.stamp_ns, odometry.last_pose @ lidar_from_body))
    recording.write_tum(trajectory, poses)
    report(summary, meter.summary(name="KISS-ICP", version=version("kiss-icp")))


if __name__ == "__main__":
    main(*sys.argv[1:])
