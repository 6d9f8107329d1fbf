"""Retro-SLAM: `retro_slam_peer.py REC.mcap OUT.tum OUT.json THREADS`.

Lidar alone, with loops; its authors' defaults. Times of points go from 0 to 1 over a scan, as its
readers give them. Deskewing is off where a scan is over long before the next begins. It takes as many
threads as it likes; the process is pinned to the same processors as the others. Its poses are the
lidar's when all loops are closed.
"""

import sys
from importlib.metadata import version
from pathlib import Path

import recording
from measure import Meter, cpu_seconds, report
from retro_slam.config import load_config
from retro_slam.slam import RetroSLAM


def main(path, trajectory, summary, threads):
    config = load_config(None)
    first = next(recording.scans(path))
    config.odometry.preprocessing.deskew = bool(
        first.offsets_ns.max() > 0.5e9 / recording.rates(path)["lidar"])
    config.odometry.registration.max_num_threads = int(threads)
    config.out_dir = str(Path(trajectory).parent)
    slam = RetroSLAM(config)
    lidar_from_body = recording.lidar_from_body(path)
    meter, stamps = Meter(), []
    for scan in recording.scans(path):
        with meter:
            slam.process_scan(scan.points, scan.offsets_ns / max(1, scan.offsets_ns.max()))
        stamps.append(scan.stamp_ns)
    begin = cpu_seconds()
    slam.exit()  # the last map and its loops
    result = meter.summary(name="Retro-SLAM", version=version("retro-slam"))
    result["cpu_ms"]["mean"] += 1e3 * (cpu_seconds() - begin) / max(1, len(stamps))
    poses = [(stamp, pose @ lidar_from_body) for stamp, pose in zip(stamps, slam.poses)]
    recording.write_tum(trajectory, poses)
    report(summary, {**result, "answered": len(poses) / max(1, len(stamps))})


if __name__ == "__main__":
    main(*sys.argv[1:])
