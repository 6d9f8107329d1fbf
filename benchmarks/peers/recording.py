"""Reads a recording's MCAP with rosbags, as a stranger to this project would, for the peers."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rosbags.highlevel import AnyReader


@dataclass
class Scan:
    stamp_ns: int
    points: np.ndarray  # n x 3, float64, lidar frame
    offsets_ns: np.ndarray  # n, since the stamp
    rings: np.ndarray
    intensity: np.ndarray


@dataclass
class Imu:
    stamp_ns: int
    gyro: tuple
    accel: tuple


def stamp_of(header):
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def scan_of(message):
    point = np.dtype({
        "names": ["x", "y", "z", "intensity", "ring", "t"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u2", "<u4"],
        "offsets": [next(f.offset for f in message.fields if f.name == name)
                    for name in ("x", "y", "z", "intensity", "ring", "t")],
        "itemsize": message.point_step,
    })
    cloud = np.frombuffer(message.data, dtype=point)
    points = np.stack([cloud["x"], cloud["y"], cloud["z"]], axis=1).astype(np.float64)
    good = np.isfinite(points).all(axis=1) & (np.abs(points).max(axis=1) > 0.0)
    return Scan(stamp_of(message.header), points[good], cloud["t"][good].astype(np.int64),
                cloud["ring"][good].astype(np.int32), cloud["intensity"][good])


def pose_of(quaternion_xyzw, translation):
    x, y, z, w = quaternion_xyzw
    result = np.eye(4)
    result[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    result[:3, 3] = translation
    return result


def matrix(transform):
    """Of a geometry_msgs Transform."""
    q, t = transform.rotation, transform.translation
    return pose_of((q.x, q.y, q.z, q.w), (t.x, t.y, t.z))


def transforms(path):
    """parent_from_child of /tf_static, as {(parent, child): 4 x 4}."""
    result = {}
    with AnyReader([Path(path)]) as reader:
        connections = [c for c in reader.connections if c.topic == "/tf_static"]
        for connection, _, raw in reader.messages(connections=connections):
            for entry in reader.deserialize(raw, connection.msgtype).transforms:
                result[entry.header.frame_id, entry.child_frame_id] = matrix(entry.transform)
    return result


def lidar_from_body(path):
    """Transform that turns a lidar trajectory into the body's (base_link, else the IMU)."""
    known = transforms(path)
    for body in ("base_link", "imu"):
        if (body, "lidar") in known:
            return np.linalg.inv(known[body, "lidar"])
    return np.eye(4)


def imu_from_lidar(path):
    known = transforms(path)
    if ("imu", "lidar") in known:
        return known["imu", "lidar"]
    if ("base_link", "imu") in known:
        return np.linalg.inv(known["base_link", "imu"]) @ known["base_link", "lidar"]
    return np.eye(4)


def imu_from_body(path):
    known = transforms(path)
    return np.linalg.inv(known["base_link", "imu"]) if ("base_link", "imu") in known else np.eye(4)


def events(path, topics=("/lidar", "/imu")):
    """Scans and IMU samples in the order of the file."""
    with AnyReader([Path(path)]) as reader:
        connections = [c for c in reader.connections if c.topic in topics]
        for connection, _, raw in reader.messages(connections=connections):
            message = reader.deserialize(raw, connection.msgtype)
            if connection.topic == "/lidar":
                yield scan_of(message)
            else:
                w, a = message.angular_velocity, message.linear_acceleration
                yield Imu(stamp_of(message.header), (w.x, w.y, w.z), (a.x, a.y, a.z))


def scans(path):
    return events(path, topics=("/lidar",))


def quaternion(rotation):
    """x y z w of a rotation matrix."""
    m = rotation
    k = np.array([
        [m[0, 0] - m[1, 1] - m[2, 2], 0, 0, 0],
        [m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], 0, 0],
        [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1], 0],
        [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
    ])
    _, vectors = np.linalg.eigh(k)
    q = vectors[:, -1]
    return q if q[3] >= 0 else -q


def rates(path):
    """Messages a second of lidar and IMU (0: none), from the times in the file."""
    result = {"lidar": 0.0, "imu": 0.0}
    with AnyReader([Path(path)]) as reader:
        for connection in reader.connections:
            if connection.topic not in ("/lidar", "/imu"):
                continue
            times = [t for _, t, _ in reader.messages(connections=[connection])]
            if len(times) > 1:
                result[connection.topic[1:]] = 1e9 / float(np.median(np.diff(times)))
    return result


def interpolated(a, b, u):
    """Pose between two, the rotation by normalised quaternions (for small steps)."""
    qa, qb = quaternion(a[:3, :3]), quaternion(b[:3, :3])
    q = (1 - u) * qa + u * (qb if qa @ qb >= 0 else -qb)
    return pose_of(q / np.linalg.norm(q), (1 - u) * a[:3, 3] + u * b[:3, 3])


def write_tum(path, stamped_poses):
    with open(path, "w") as out:
        for stamp_ns, pose in stamped_poses:
            values = [*pose[:3, 3], *quaternion(pose[:3, :3])]
            out.write(f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d} "
                      + " ".join(f"{v:.9f}" for v in values) + "\n")
