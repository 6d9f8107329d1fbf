"""Packets of a PandarXT-32 in a ROS 2 bag (PandarScan) against the cloud that the nebula driver made of
them. Where the package hydra4 is installed, against that, too.

Every return of nebula's scan is among ours. Channel, range and azimuth of the block are the same, and so
is the place to the rounding of its numbers. nebula cuts a scan by the corrected azimuth of each channel,
this project by that of the block. The few returns between lie in the scan before or behind. hydra4 reads
the first return of a pair alone, and places it in the same way.
"""

import collections
import sqlite3
import struct
import types

import numpy as np

from scans import DATA, check, read_scans, skip_without

folder = skip_without(DATA / "nebula_xt32")
calibration = DATA / "PandarXT32.csv"
bag = next(folder.glob("*/*.db3"))
angles = np.genfromtxt(calibration, delimiter=",", skip_header=1)
STEP_M = 0.004


def keys_of(points):
    """Channel, range in steps, azimuth of the block in hundredths of a degree, of each point"""
    ranges = np.linalg.norm(points, axis=1)
    elevation = np.degrees(np.arcsin(points[:, 2] / ranges))
    channel = np.abs(elevation[:, None] - angles[None, :, 1]).argmin(axis=1)
    azimuth = np.degrees(np.arctan2(points[:, 0], points[:, 1])) - angles[channel, 2]
    steps, block = ranges / STEP_M, azimuth * 100.0
    check(np.abs(steps - np.round(steps)).max() < 0.01, "ranges are no whole steps")
    check(np.abs(block - np.round(block)).max() < 0.02, "azimuths are no whole hundredths")
    return list(zip(channel.tolist(), np.round(steps).astype(int).tolist(),
                    (np.round(block).astype(int) % 36000).tolist()))


def places(points):
    return np.stack([points[axis] for axis in "xyz"], axis=1).astype(float)


scans = list(read_scans(bag, calibration))
cloud = (folder / "1673400678101968885.pcd").read_bytes()
begin = cloud.index(b"DATA binary\n") + len(b"DATA binary\n")
theirs = np.frombuffer(cloud[begin:], "<f4").reshape(-1, 3).astype(float)
ours = max((places(points) for _, points in scans),
           key=lambda points: len(set(keys_of(points)) & set(keys_of(theirs))))
check(abs(len(ours) - len(theirs)) < 64, f"{len(ours)} returns, nebula has {len(theirs)}")
wanted, found = collections.Counter(keys_of(theirs)), collections.Counter(keys_of(ours))
missing = wanted - found
check(sum(missing.values()) < 64, f"{sum(missing.values())} returns of nebula are not in the scan")
check(all(key[2] == 0 for key in missing), "returns are missing within the scan")
everything = collections.Counter()
for _, points in scans:
    everything.update(keys_of(places(points)))
check(not wanted - everything, "returns of nebula are in no scan")
index = {key: i for i, key in enumerate(keys_of(ours))}
error = max(np.abs(theirs[i] - ours[index[key]]).max()
            for i, key in enumerate(keys_of(theirs)) if key in index)
check(error < 0.0001, f"a return lies {error} m elsewhere")
print(f"nebula: {len(theirs)} returns, {sum((wanted & found).values())} in the same scan, "
      f"the others beside it; farthest apart {error:.6f} m")

try:
    from hydra4.decoders.pandar_xt32 import PandarXT32
except ImportError:
    print("hydra4 is not installed")
else:
    decoder = PandarXT32(calibration, 0.1, 300.0)
    timed = {}
    for stamp, points in scans:
        for key, t in zip(keys_of(places(points)), points["t"]):
            timed.setdefault(key, []).append(stamp + int(t))
    compared = 0
    for (data,) in sqlite3.connect(bag).execute("select data from messages"):
        count_at = data.index(b"hesai\0") + 6
        count_at += -count_at % 4
        (count,) = struct.unpack_from("<I", data, count_at)
        for i in range(0, count, 25):
            at = count_at + 4 + i * 1512 + 8
            packet = types.SimpleNamespace(data=data[at:at + 1080])
            for block in decoder(packet):
                made = np.array([point[:3] for point in block.points])
                pairs = [(timed[key], point[6]) for key, point in zip(keys_of(made), block.points)
                         if len(timed.get(key, ())) == 1]  # the first scan may be left out
                if not pairs:
                    continue
                # Times from channel to channel. It adds those of blocks, in microseconds, to seconds.
                (first,), begin = pairs[0]
                for (time,), theirs_s in pairs:
                    check(abs((time - first) * 1e-9 - (theirs_s - begin)) < 1e-6, "times differ")
                compared += len(pairs)
    check(compared > 4_000, f"only {compared} returns compared")
    print(f"hydra4: {compared} returns in the same places, channels' times equal to 1 us")
