"""DLIO out of the PyPI package evalio: `dlio_peer.py REC.mcap OUT.tum OUT.json THREADS [PACE]`.

A scan is held back until the IMU covers its end, and scans come no faster than PACE times the
sensor's rate: DLIO's answer depends on how far its helper threads have come. Every parameter is set
explicitly, to its own default. CPU time is that of the process without the conversion of points.
"""

import sys
import time
from importlib.metadata import version

import numpy as np
import recording
from evalio.pipelines import DLIO
from evalio.types import (SE3, SO3, Duration, ImuMeasurement, ImuParams, LidarMeasurement,
                          LidarParams, Point, Stamp)
from measure import cpu_seconds, report

import resource

SCAN_NS = 100_000_000


def measurement(scan):
    columns = np.minimum(scan.offsets_ns * 1024 // SCAN_NS, 1023)
    x, y, z = (scan.points[:, i].tolist() for i in range(3))
    points = [Point(x=a, y=b, z=c, intensity=i, t=Duration.from_nsec(t), row=r, col=k)
              for a, b, c, i, t, r, k in zip(x, y, z, scan.intensity.tolist(),
                                             scan.offsets_ns.tolist(), scan.rings.tolist(),
                                             columns.tolist())]
    return LidarMeasurement(Stamp.from_nsec(scan.stamp_ns), points)


def started(path):
    pipeline = DLIO()
    transform = recording.imu_from_lidar(path)
    q = recording.quaternion(transform[:3, :3])
    pipeline.set_imu_T_lidar(SE3(SO3(qx=q[0], qy=q[1], qz=q[2], qw=q[3]), transform[:3, 3]))
    pipeline.set_imu_params(ImuParams(gyro=1e-4, accel=1e-3, gyro_bias=1e-5, accel_bias=1e-4,
                                      gravity=np.array([0.0, 0.0, -9.81]), rate=200.0))
    pipeline.set_lidar_params(LidarParams(num_rows=128, num_columns=1024, min_range=0.5,
                                          max_range=100.0))
    pipeline.set_params(DLIO.default_params())
    pipeline.initialize()
    return pipeline


def pose_matrix(pose):
    return np.asarray(pose.to_mat())


def at_scan_stamps(estimates, stamps):
    """DLIO answers for another moment of the scan: its poses are interpolated to the scans' stamps."""
    times = np.array([t for t, _ in estimates])
    result = []
    for stamp in stamps:
        j = int(np.searchsorted(times, stamp))
        if j < len(times) and times[j] == stamp:
            result.append((stamp, estimates[j][1]))
            continue
        if j == 0 or j == len(times) or times[j] - times[j - 1] > 2 * SCAN_NS:
            continue
        u = (stamp - times[j - 1]) / (times[j] - times[j - 1])
        a, b = estimates[j - 1][1], estimates[j][1]
        qa, qb = recording.quaternion(a[:3, :3]), recording.quaternion(b[:3, :3])
        q = (1 - u) * qa + u * (qb if qa @ qb >= 0 else -qb)
        q /= np.linalg.norm(q)
        pose = recording.matrix(Placed(q, (1 - u) * a[:3, 3] + u * b[:3, 3]))
        result.append((stamp, pose))
    return result


class Placed:
    """A transform with the attribute names of a ROS message."""

    def __init__(self, q, t):
        self.rotation = type("Q", (), dict(zip("xyzw", q)))
        self.translation = type("T", (), dict(zip("xyz", t)))


class Feeder:
    def __init__(self, pipeline, pace):
        self.pipeline, self.pace = pipeline, pace
        self.held, self.stamps, self.estimates = [], [], []
        self.conversion_s = 0.0
        self.next_time = time.perf_counter()

    def imu(self, sample):
        self.pipeline.add_imu(ImuMeasurement(Stamp.from_nsec(sample.stamp_ns),
                                             np.array(sample.gyro), np.array(sample.accel)))
        while self.held and sample.stamp_ns >= self.held[0].stamp_ns + SCAN_NS:
            self.feed(self.held.pop(0))

    def feed(self, scan):
        begin = time.thread_time()
        converted = measurement(scan)
        self.conversion_s += time.thread_time() - begin
        now = time.perf_counter()
        time.sleep(max(0.0, self.next_time - now))
        self.next_time = max(now, self.next_time) + SCAN_NS * 1e-9 / self.pace
        self.stamps.append(scan.stamp_ns)
        self.pipeline.add_lidar(converted)
        self.collect()

    def collect(self):
        for stamp, pose in self.pipeline.saved_estimates():
            self.estimates.append((stamp.to_nsec(), pose_matrix(pose)))
        self.pipeline.saved_maps()
        self.pipeline.saved_features()


def main(path, trajectory, summary, threads, pace="1.0"):
    del threads  # as many as it likes; the process is pinned to the same CPUs as the others
    feeder = Feeder(started(path), float(pace))
    reading = 0.0
    begin = cpu_seconds()
    stream = recording.events(path)
    while True:
        mark = time.thread_time()
        event = next(stream, None)
        reading += time.thread_time() - mark
        if event is None:
            break
        if isinstance(event, recording.Imu):
            feeder.imu(event)
        else:
            feeder.held.append(event)
    time.sleep(0.5)
    feeder.collect()
    cpu = cpu_seconds() - begin - reading - feeder.conversion_s
    # The pose is the IMU's.
    imu_from_body = recording.imu_from_body(path)
    poses = at_scan_stamps([(t, p @ imu_from_body) for t, p in sorted(feeder.estimates,
                                                                        key=lambda e: e[0])],
                           feeder.stamps)
    recording.write_tum(trajectory, poses)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
    per_scan = 1e3 * cpu / max(1, len(feeder.stamps))
    report(summary, {"name": "DLIO (evalio)", "version": version("evalio"),
                     "scans": len(feeder.stamps), "cpu_ms": {"mean": per_scan},
                     "peak_memory_mb": peak})


if __name__ == "__main__":
    main(*sys.argv[1:])
