"""A pipeline out of the PyPI package evalio:
`evalio_peer.py REC.mcap OUT.tum OUT.json THREADS PIPELINE [PACE]`.

Scans are handed over as evalio's own loaders do: organised by ring and column, in the order of rows.
Zeros stand where nothing came back, and times count from the start of the scan. A scan is held back
until the IMU covers its end. With PACE, scans come no faster than PACE times the sensor's rate. The
answers of DLIO and LIO-SAM depend on how far their helper threads have come. Parameters are their
authors' defaults but for what CHANGES names. CPU time is that of all threads without the reading and the
conversion of points.
"""

import resource
import sys
import time
from importlib.metadata import version

import evalio.pipelines
import numpy as np
import recording
from evalio._cpp.helpers import (DataType, Field, PointCloudMetadata, fill_col_row_major,
                                 pc2_to_evalio)
from evalio.types import SE3, SO3, ImuMeasurement, ImuParams, LidarParams, Stamp
from measure import Meter, cpu_seconds, report

# What deskews by itself is told to; threads are what everybody gets.
# They take a scan to last until the next one: where it is over long before, they do better without.
CHANGES = {
    "KissICP": lambda threads, whole: {"deskew": whole, "max_num_threads": threads},
    "GenZICP": lambda threads, whole: {"deskew": whole},
    "MadICP": lambda threads, whole: {"deskew": whole, "num_threads": threads, "realtime": False},
    "CTICP": lambda threads, whole: {"ls_num_threads": threads},
    "FORM": lambda threads, whole: {"num_threads": threads},
    "LioSAM": lambda threads, whole: {"numberOfCores": threads},
}
# Work goes on in threads of their own after a scan was handed over.
CONCURRENT = {"DLIO", "LioSAM"}
POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("t", "<u4"),
                  ("ring", "<u2")])
FIELDS = [Field(name=name, datatype=kind, offset=POINT.fields[name][1])
          for name, kind in (("x", DataType.FLOAT32), ("y", DataType.FLOAT32),
                             ("z", DataType.FLOAT32), ("intensity", DataType.FLOAT32),
                             ("t", DataType.UINT32), ("ring", DataType.UINT16))]


class Organiser:
    """Puts the points of a scan into rings and columns."""

    def __init__(self, scan, period_ns):
        self.rows = next(rows for rows in (4, 16, 32, 128) if scan.rings.max() < rows)
        # A sensor with fixed firing times: a column is a firing of all lasers. Four are the lines of a Mid-360.
        firing_ns = {4: 20_000, 16: 55_296, 32: 55_296, 128: period_ns / 1024}[self.rows]
        # Where not every revolution is recorded, a scan is over long before the next begins.
        sweep_ns = min(period_ns, 1.02 * scan.offsets_ns.max() + firing_ns)
        if sweep_ns > 0.9 * period_ns:
            sweep_ns = period_ns
        self.whole = bool(sweep_ns > 0.5 * period_ns)
        self.columns = int(np.ceil(sweep_ns / firing_ns))
        self.firing_ns = firing_ns

    def measurement(self, scan):
        image = np.zeros((self.rows, self.columns), dtype=POINT)
        image["ring"] = np.arange(self.rows, dtype=np.uint16)[:, None]
        image["t"] = (np.arange(self.columns) * self.firing_ns).astype(np.uint32)[None, :]
        at = scan.rings, np.minimum(scan.offsets_ns // self.firing_ns, self.columns - 1).astype(int)
        for k, name in enumerate("xyz"):
            image[name][at] = scan.points[:, k]
        image["intensity"][at] = scan.intensity
        image["t"][at] = scan.offsets_ns
        meta = PointCloudMetadata(stamp=Stamp.from_nsec(scan.stamp_ns), width=self.columns,
                                  height=self.rows, point_step=POINT.itemsize,
                                  row_step=POINT.itemsize * self.columns, is_bigendian=0,
                                  is_dense=0)
        result = pc2_to_evalio(meta, FIELDS, image.tobytes())
        fill_col_row_major(result)
        return result


def started(name, path, organiser, rates, threads):
    pipeline = getattr(evalio.pipelines, name)()
    transform = recording.imu_from_lidar(path)
    q = recording.quaternion(transform[:3, :3])
    pipeline.set_imu_T_lidar(SE3(SO3(qx=q[0], qy=q[1], qz=q[2], qw=q[3]), transform[:3, 3]))
    pipeline.set_imu_params(ImuParams(gyro=1e-4, accel=1e-3, gyro_bias=1e-5, accel_bias=1e-4,
                                      gravity=np.array([0.0, 0.0, -9.81]), rate=rates["imu"]))
    pipeline.set_lidar_params(LidarParams(num_rows=organiser.rows, num_columns=organiser.columns,
                                          min_range=0.5, max_range=100.0, rate=rates["lidar"]))
    parameters = dict(pipeline.default_params())
    parameters.update(CHANGES.get(name, lambda *_: {})(threads, organiser.whole))
    pipeline.set_params(parameters)
    pipeline.initialize()
    return pipeline


def at_scan_stamps(estimates, stamps, period_ns):
    """Some answer for another moment of the scan: poses are interpolated to the scans' stamps."""
    times = np.array([t for t, _ in estimates])
    result = []
    for stamp in stamps:
        j = int(np.searchsorted(times, stamp))
        if j < len(times) and times[j] == stamp:
            result.append((stamp, estimates[j][1]))
            continue
        if j == 0 or j == len(times) or times[j] - times[j - 1] > 2 * period_ns:
            continue
        u = (stamp - times[j - 1]) / (times[j] - times[j - 1])
        a, b = estimates[j - 1][1], estimates[j][1]
        result.append((stamp, recording.interpolated(a, b, u)))
    return result


class Feeder:
    def __init__(self, name, path, threads, pace):
        self.name, self.path, self.threads, self.pace = name, path, threads, pace
        self.pipeline = self.organiser = None
        self.rates = recording.rates(path)
        self.period_ns = int(1e9 / self.rates["lidar"])
        self.held, self.stamps, self.estimates = [], [], []
        self.waiting_imu = []
        self.unmeasured_s = 0.0  # CPU of the conversion
        self.meter = Meter()
        self.next_time = time.perf_counter()

    def imu(self, sample):
        measured = ImuMeasurement(Stamp.from_nsec(sample.stamp_ns), np.array(sample.gyro),
                                  np.array(sample.accel))
        if self.pipeline is None:
            self.waiting_imu.append(measured)
        else:
            self.pipeline.add_imu(measured)
        while self.held and sample.stamp_ns >= self.held[0].stamp_ns + self.period_ns:
            self.feed(self.held.pop(0))

    def scan(self, scan):
        if self.pipeline is None:
            self.organiser = Organiser(scan, self.period_ns)
            self.pipeline = started(self.name, self.path, self.organiser, self.rates, self.threads)
            for measured in self.waiting_imu:
                self.pipeline.add_imu(measured)
        self.held.append(scan)
        if self.rates["imu"] == 0.0:
            self.feed(self.held.pop(0))

    def feed(self, scan):
        begin = time.thread_time()
        converted = self.organiser.measurement(scan)
        self.unmeasured_s += time.thread_time() - begin
        if self.pace > 0.0:
            now = time.perf_counter()
            time.sleep(max(0.0, self.next_time - now))
            self.next_time = max(now, self.next_time) + self.period_ns * 1e-9 / self.pace
        self.stamps.append(scan.stamp_ns)
        with self.meter:
            self.pipeline.add_lidar(converted)
        self.collect()

    def collect(self):
        for stamp, pose in self.pipeline.saved_estimates():
            self.estimates.append((stamp.to_nsec(), np.asarray(pose.to_mat())))
        self.pipeline.saved_maps()
        self.pipeline.saved_features()


def main(path, trajectory, summary, threads, name, pace="0"):
    feeder = Feeder(name, path, int(threads), float(pace))
    reading, begin = 0.0, cpu_seconds()
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
            feeder.scan(event)
    for scan in feeder.held:
        feeder.feed(scan)
    if name in CONCURRENT:
        time.sleep(1.0)
    feeder.collect()
    cpu = cpu_seconds() - begin - reading - feeder.unmeasured_s
    imu_from_body = recording.imu_from_body(path)  # the pose is the IMU's
    estimates = sorted(((t, p @ imu_from_body) for t, p in feeder.estimates), key=lambda e: e[0])
    poses = at_scan_stamps(estimates, feeder.stamps, feeder.period_ns)
    recording.write_tum(trajectory, poses)
    scans = max(1, len(feeder.stamps))
    result = {"name": name, "version": f"evalio {version('evalio')}", "scans": len(feeder.stamps),
              "answered": len(poses) / scans, "cpu_ms": {"mean": 1e3 * cpu / scans},
              "peak_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6}
    if name not in CONCURRENT:
        result["wall_ms"] = feeder.meter.summary()["wall_ms"]
    report(summary, result)


if __name__ == "__main__":
    main(*sys.argv[1:])
