"""Livox CustomMsg of both drivers as the Python package rosbags writes it, in a ROS 1 bag, a ROS 2 bag
and an MCAP. Every point is read here with its own time, line and reflectivity. What the simulator writes
of a Mid-360 is read by rosbags."""

import pathlib
import sys
import tempfile

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Bag1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Bag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from scans import check, read_scans

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "bad_input"))
from program import simulated

POINT_TEXT = """uint32 offset_time
float32 x
float32 y
float32 z
uint8 reflectivity
uint8 tag
uint8 line
"""
START = 1_700_000_000_123_456_789
STEP = 100_000_000


def register(store, package):
    text = f"std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\n" \
           f"uint8[3] rsvd\n{package}/CustomPoint[] points\n"
    store.register({**get_types_from_msg(POINT_TEXT, f"{package}/msg/CustomPoint"),
                    **get_types_from_msg(text, f"{package}/msg/CustomMsg")})


def make_points(random, count):
    return {"offset_time": np.sort(random.integers(0, 99_900_000, count)),
            "x": random.uniform(1, 40, count).astype(np.float32),
            "y": random.uniform(-40, 40, count).astype(np.float32),
            "z": random.uniform(-2, 20, count).astype(np.float32),
            "reflectivity": random.integers(0, 256, count), "tag": np.zeros(count, int),
            "line": random.integers(0, 4, count)}


RANDOM = np.random.default_rng(8)
FRAMES = [(START + k * STEP, make_points(RANDOM, 300 + k)) for k in range(12)]


def message(store, package, stamp, points, ros1):
    types = store.types
    time = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    header = types["std_msgs/msg/Header"](stamp=time, frame_id="livox_frame",
                                          **({"seq": 0} if ros1 else {}))
    point = types[f"{package}/msg/CustomPoint"]
    count = len(points["x"])
    return types[f"{package}/msg/CustomMsg"](
        header=header, timebase=stamp, point_num=count, lidar_id=0, rsvd=np.zeros(3, np.uint8),
        points=[point(**{name: values[i].item() for name, values in points.items()})
                for i in range(count)])


def write(path, package, kind):
    ros1 = kind == "bag"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    register(store, package)
    type_ = f"{package}/msg/CustomMsg"
    plugins = {"db3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}
    with Bag1(path) if ros1 else Bag2(path, version=8, storage_plugin=plugins[kind]) as writer:
        topic = writer.add_connection("/livox/lidar", type_, typestore=store)
        for stamp, points in FRAMES:
            made = message(store, package, stamp, points, ros1)
            data = store.serialize_ros1(made, type_) if ros1 else store.serialize_cdr(made, type_)
            writer.write(topic, stamp + STEP, data)


def compare(path):
    scans = list(read_scans(path))
    check(len(scans) == len(FRAMES), f"{path}: {len(scans)} scans")
    for (stamp, points), (begin, theirs) in zip(scans, FRAMES):
        check(len(points) == len(theirs["x"]), f"{path}: {len(points)} points")
        for axis in "xyz":
            check((points[axis] == theirs[axis]).all(), f"{path}: {axis} differs")
        check((points["intensity"] == theirs["reflectivity"]).all(), f"{path}: reflectivity")
        check((points["ring"] == theirs["line"]).all(), f"{path}: line")
        times = stamp + points["t"].astype(np.int64)
        check((times == begin + theirs["offset_time"]).all(), f"{path}: times differ")


def read_simulated():
    recording = simulated("mid360", 3, 0.6)
    ours = list(read_scans(recording))
    with AnyReader([recording], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        topic = [c for c in reader.connections if c.topic == "/livox/lidar"]
        check(topic and topic[0].msgtype == "livox_ros_driver2/msg/CustomMsg", "no such topic")
        theirs = [reader.deserialize(data, c.msgtype) for c, _, data in reader.messages(topic)]
    check(len(ours) == len(theirs) and len(ours) > 3, f"{len(ours)} and {len(theirs)} scans")
    for (stamp, points), made in zip(ours, theirs):
        check(made.point_num == len(made.points) == len(points), "numbers of points differ")
        check(made.timebase == made.header.stamp.sec * 10**9 + made.header.stamp.nanosec, "timebase")
        check(stamp == made.timebase, "stamps differ")
        for i in range(0, len(points), 97):
            point = made.points[i]
            check((point.x, point.y, point.z, point.line, point.offset_time) ==
                  tuple(points[name][i] for name in ("x", "y", "z", "ring", "t")), "a point differs")
    return len(ours)


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    for package in ("livox_ros_driver", "livox_ros_driver2"):
        for kind in ("bag", "db3", "mcap"):
            path = folder / (f"{package}.bag" if kind == "bag" else f"{package}_{kind}")
            write(path, package, kind)
            compare(path)
    print("6 recordings of rosbags,", read_simulated(), "simulated scans: equal")
