"""Super-LIO, a program of its own (GPL-3.0): `super_lio_peer.py REC.mcap OUT.tum OUT.json THREADS`.

Its authors' defaults for a Mid-360, but for the recording's extrinsics and the least and largest range
of the simulated lidars. Its Python package takes the clouds of that sensor alone, by the middleware
iceoryx2. It works in threads of its own, and a queue of two messages drops what comes too fast. So it is
fed at the sensors' rate. Once it answers, each scan waits for the answer to the one before. It brings a
libGLdispatch that ends the process where the system has OpenGL, so the system's is loaded first. Its
poses are the IMU's. CPU time is that of all threads without the reading.
"""

import ctypes as c
import glob
import os
import resource
import sys
import time
from importlib.metadata import version
from pathlib import Path

SYSTEM_GL = sorted(glob.glob("/usr/lib/*/libGLdispatch.so.0"))
if SYSTEM_GL and "LD_PRELOAD" not in os.environ:
    os.environ["LD_PRELOAD"] = SYSTEM_GL[0]
    os.execv(sys.executable, [sys.executable, *sys.argv])

import iceoryx2 as iox2  # noqa: E402
import inertial_feed  # noqa: E402
import numpy as np  # noqa: E402
import recording  # noqa: E402
import super_lio  # noqa: E402
from measure import cpu_seconds, report  # noqa: E402

MOST_POINTS = 200_000
POINT = np.dtype([(name, "<f4") for name in ("x", "y", "z", "intensity", "seconds")])
SERVICE = f"understory/{os.getpid()}/"
SETTINGS = """lio:
  map: {{save_map: false, if_filter: true, save_map_dir: "map", map_name: "map.pcd", ds_size: 0.25, save_interval: 500}}
  iceoryx: {{imu_service: "{service}imu", lidar_service: "{service}lidar", odom_service: "{service}odometry",
            cloud_service: "{service}map"}}
  sensor: {{lidar_type: 1, blind: 0.5, maxrange: 100.0, filter_rate: 3, enable_downsample: true,
           voxel_filter_size: 0.5, gravity_norm: 9.7946, imu_type: 1, imu_na: 0.1, imu_ng: 0.1, imu_nba: 0.0001,
           imu_nbg: 0.0001}}
  extrinsic: {{lidar_imu: [{transform}], odom_robo: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]}}
  hash_map: {{hash_capacity: 2000000, vox_resolution: 0.5}}
  kf: {{kf_type: 0, kf_max_iterations: 4, kf_align_gravity: true, kf_quit_eps: 0.001}}
  submap: {{submap_resolution: 0.5, submap_capacity: 5000}}
  output: {{robot: false, plan_env_world: false, plan_env_body: false, ml_map: false, planner: false, map: false,
           dense: false, pub_step: 1}}
  eva: {{timer: false}}
"""


class Header(c.Structure):
    _fields_ = [("sec", c.c_uint32), ("nanosec", c.c_uint32), ("frame_id", c.c_char * 64)]


class Imu(c.Structure):
    _fields_ = [("header", Header), ("orientation", c.c_double * 4), ("orientation_covariance", c.c_double * 9),
                ("rates", c.c_double * 3), ("rates_covariance", c.c_double * 9), ("force", c.c_double * 3),
                ("force_covariance", c.c_double * 9)]

    @staticmethod
    def type_name():
        return "Imu"


class PointField(c.Structure):
    _fields_ = [("name", c.c_char * 32), ("offset", c.c_uint32), ("datatype", c.c_uint8), ("count", c.c_uint32),
                ("padding", c.c_uint8 * 3)]


class PointCloud2(c.Structure):
    _fields_ = [("header", Header), ("height", c.c_uint32), ("width", c.c_uint32), ("fields_count", c.c_uint32),
                ("fields", PointField * 6), ("is_bigendian", c.c_bool), ("point_step", c.c_uint32),
                ("row_step", c.c_uint32), ("data_length", c.c_uint32),
                ("data", c.c_uint8 * (MOST_POINTS * POINT.itemsize)), ("is_dense", c.c_bool),
                ("padding", c.c_uint8 * 3)]

    @staticmethod
    def type_name():
        return "PointCloud2"


class Odometry(c.Structure):
    _fields_ = [("header", Header), ("position", c.c_double * 3), ("orientation", c.c_double * 4),
                ("pose_covariance", c.c_double * 36), ("twist", c.c_double * 6), ("twist_covariance", c.c_double * 36)]

    @staticmethod
    def type_name():
        return "Odometry"


class Link:
    """Messages to and from the odometry."""

    def __init__(self):
        self.node = iox2.NodeBuilder.new().create(iox2.ServiceType.Ipc)
        self.imu = self.service("imu", Imu).publisher_builder().create()
        self.lidar = self.service("lidar", PointCloud2).publisher_builder().create()
        self.odometry = self.service("odometry", Odometry).subscriber_builder().create()
        self.cloud = PointCloud2()
        self.found = []

    def service(self, name, kind):
        return self.node.service_builder(iox2.ServiceName.new(SERVICE + name)).publish_subscribe(kind).open_or_create()

    def send_imu(self, stamp_ns, row):
        message = Imu()
        message.header.sec, message.header.nanosec = divmod(stamp_ns, 10**9)
        message.orientation[3] = 1.0
        message.force[:], message.rates[:] = row[1:4], row[4:7]
        self.imu.send_copy(message)

    def send_scan(self, scan):
        order = np.argsort(scan.offsets_ns, kind="stable")[:MOST_POINTS]
        points = np.zeros(len(order), dtype=POINT)
        for k, name in enumerate("xyz"):
            points[name] = scan.points[order, k]
        points["intensity"], points["seconds"] = scan.intensity[order], 1e-9 * scan.offsets_ns[order]
        cloud = self.cloud
        cloud.header.sec, cloud.header.nanosec = divmod(scan.stamp_ns, 10**9)
        cloud.height, cloud.width, cloud.point_step = 1, len(points), POINT.itemsize
        cloud.row_step = cloud.data_length = points.nbytes
        c.memmove(cloud.data, points.tobytes(), points.nbytes)
        self.lidar.send_copy(cloud)

    def await_answer(self):
        """To the scan before: up to a second, once the first one is answered."""
        deadline, before = time.perf_counter() + 1.0, len(self.found)
        self.collect()
        while before and len(self.found) == before and time.perf_counter() < deadline:
            time.sleep(0.001)
            self.collect()

    def collect(self):
        while (sample := self.odometry.receive()) is not None:
            m = sample.payload().contents
            self.found.append((m.header.sec * 10**9 + m.header.nanosec,
                               recording.pose_of(list(m.orientation), list(m.position))))


def main(path, trajectory, summary, threads):
    os.environ["OMP_NUM_THREADS"] = os.environ["TBB_NUM_THREADS"] = threads
    transform = recording.imu_from_lidar(path)
    config = Path(trajectory).with_suffix(".yaml")
    config.write_text(SETTINGS.format(service=SERVICE, transform=", ".join(
        f"{v:.9f}" for v in [*transform[:3, 3], *transform[:3, :3].ravel()])))
    runner = super_lio.SuperLIORunner()
    if not runner.init(str(config)):
        sys.exit("it does not begin with its settings")
    runner.start()
    link, stamps = Link(), []
    time.sleep(1.0)
    spent, begin, clock = 0.0, cpu_seconds(), time.perf_counter()
    mark = time.thread_time()
    for scan, imu, _, start in inertial_feed.frames(path):
        for i, row in enumerate(imu):
            time.sleep(max(0.0, clock + row[0] - time.perf_counter()))
            link.send_imu(start + round(1e9 * row[0]), row)
            if i == 0:  # it covers the end of the scan before
                link.await_answer()
                clock = max(clock, time.perf_counter() - row[0])
        link.send_scan(scan)
        stamps.append(scan.stamp_ns)
    spent += time.thread_time() - mark
    time.sleep(1.0)
    link.collect()
    runner.stop()
    imu_from_body = recording.imu_from_body(path)
    found = sorted(((t, pose @ imu_from_body) for t, pose in link.found), key=lambda e: e[0])
    poses = inertial_feed.at_stamps(found, stamps, 2e9 / recording.rates(path)["lidar"])
    recording.write_tum(trajectory, poses)
    scans = max(1, len(stamps))
    report(summary, {"name": "Super-LIO", "version": version("super-lio"), "scans": len(stamps),
                     "answered": len(poses) / scans,
                     "cpu_ms": {"mean": 1e3 * (cpu_seconds() - begin - spent) / scans},
                     "peak_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6})


if __name__ == "__main__":
    main(*sys.argv[1:])
