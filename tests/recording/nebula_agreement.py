"""VLP-16 packets in a ROS 2 bag against the cloud that the nebula driver made of them.

The same returns: ring, range and intensity of each are equal. Azimuths agree to the format's 0.01
degrees, except where that driver does not interpolate them. For the last pair of blocks of each packet
it repeats the blocks' azimuth. For the second block of a dual-return pair it takes the difference to a
block at the same azimuth. There it is up to one and a half blocks of turn (0.6 degrees) off.
"""

import collections

import numpy as np

from scans import DATA, check, read_scans, skip_without

folder = skip_without(DATA / "nebula_vlp16")
cloud = (folder / "1673400472138016708.pcd").read_bytes()
begin = cloud.index(b"DATA binary\n") + len(b"DATA binary\n")
theirs = np.frombuffer(cloud[begin:], np.dtype([
    ("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "u1"), ("return_type", "u1"),
    ("ring", "<u2"), ("azimuth", "<f4"), ("elevation", "<f4"), ("range", "<f4"), ("t", "<u4")]))
ours = max((points for _, points in read_scans(next(folder.glob("*/*.db3")))), key=lambda points:
           np.isclose(points["intensity"].sum(), theirs["intensity"].astype(float).sum(), rtol=0.01)
           * len(points))
xyz = np.stack([ours[k] for k in "xyz"], axis=1).astype(float)
ranges = np.round(np.linalg.norm(xyz, axis=1) / 0.002).astype(int)
azimuth = np.degrees(np.arctan2(-xyz[:, 1], xyz[:, 0])) % 360.0
their_azimuth = np.degrees(theirs["azimuth"].astype(float))
# Their least range is 0.5 m, and their scan begins and ends with a packet.
kept = np.flatnonzero((ranges >= 250) & (azimuth > their_azimuth.min() - 0.01)
                      & (azimuth < their_azimuth.max() + 0.005))
check(len(kept) == len(theirs), f"{len(kept)} returns, nebula has {len(theirs)}")

waiting = collections.defaultdict(list)
for i in kept:
    waiting[ours["ring"][i], ranges[i], int(ours["intensity"][i])].append(i)


def take_nearest(k, limit_deg):
    """Our return with the same ring, range and intensity, nearest in azimuth; None beyond limit."""
    point = theirs[k]
    candidates = waiting[point["ring"], round(float(point["range"]) / 0.002),
                         int(point["intensity"])]
    best = min(candidates, key=lambda i: abs(azimuth[i] - their_azimuth[k]), default=None)
    if best is None or abs(azimuth[best] - their_azimuth[k]) > limit_deg:
        return None
    candidates.remove(best)
    return best


left = []
for k, point in enumerate(theirs):
    best = take_nearest(k, 0.01)
    if best is None:
        left.append(k)
        continue
    distance = np.linalg.norm(xyz[best] - [float(point[axis]) for axis in "xyz"])
    check(distance < 0.001 + np.radians(0.01) * point["range"], f"{point} lies elsewhere")
LAST_PAIR_NS = 20 * 55_296  # counted as in single-return mode
last = [k for k in left if theirs["t"][k] >= LAST_PAIR_NS]
second = [k for k in left if theirs["t"][k] < LAST_PAIR_NS]
for k in sorted(left, key=lambda k: their_azimuth[k]):
    point = theirs[k]
    rest = waiting[point["ring"], round(float(point["range"]) / 0.002), int(point["intensity"])]
    check(rest, f"no return like {point}")
    first = rest.pop(int(np.argmin(azimuth[rest])))  # in the order of the azimuth
    check(abs(azimuth[first] - their_azimuth[k]) < 0.62, f"{point} lies elsewhere")
check(not any(waiting.values()), "returns of ours are left over")
check(len(last) < len(theirs) / 5 and len(second) < len(theirs) / 50, "too few are equal")
print(f"{len(theirs)} returns: {len(theirs) - len(left)} equal, {len(last)} in last blocks, "
      f"{len(second)} second returns")
