"""small_gicp (PyPI) as scan-to-model odometry: `small_gicp_peer.py REC.mcap OUT.tum OUT.json THREADS`.

Voxel GICP against an incremental Gaussian voxel map, as its own odometry example does: 0.25 m
downsampling, 1 m voxels, constant velocity as the start. No deskewing: it offers none.
"""

import sys
from importlib.metadata import version

import numpy as np
import recording
import small_gicp
from measure import Meter, report


def main(path, trajectory, summary, threads):
    threads = int(threads)
    lidar_from_body = recording.lidar_from_body(path)
    world = small_gicp.GaussianVoxelMap(1.0)
    pose, step = np.eye(4), np.eye(4)
    meter, poses = Meter(), []
    for scan in recording.scans(path):
        with meter:
            cloud, _ = small_gicp.preprocess_points(scan.points, downsampling_resolution=0.25,
                                                    num_threads=threads)
            if world.size() > 0:
                result = small_gicp.align(world, cloud, pose @ step, num_threads=threads)
                step = np.linalg.inv(pose) @ result.T_target_source
                pose = result.T_target_source
            world.insert(cloud, pose)
        poses.append((scan.stamp_ns, pose @ lidar_from_body))
    recording.write_tum(trajectory, poses)
    report(summary, meter.summary(name="small_gicp", version=version("small_gicp")))


if __name__ == "__main__":
    main(*sys.argv[1:])
