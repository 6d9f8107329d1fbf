"""Recordings go both ways between this project and the Python packages mcap, mcap-ros2-support and
rosbags. What they write (MCAP, ROS 1 and ROS 2 bags, every compression) is read here value for value.
They read what is written here."""

import os
import pathlib
import subprocess
import tempfile

import numpy as np
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as PlainMcapWriter
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as McapWriter
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Bag1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Bag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from scans import check, read_scans

POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2"),
                  ("pad", "<u2"), ("t", "<u4")])
TYPES = {"/tf_static": "tf2_msgs/msg/TFMessage", "/fix": "sensor_msgs/msg/NavSatFix",
         "/imu": "sensor_msgs/msg/Imu", "/points": "sensor_msgs/msg/PointCloud2"}
FIELD_TYPES = {"ring": 4, "t": 6}
START = 1_700_000_000_123_456_789


def make_clouds(count=5, points=400):
    random = np.random.default_rng(3)
    clouds = []
    for k in range(count):
        cloud = np.zeros(points, POINT)
        for axis in "xyz":
            cloud[axis] = random.uniform(1, 50, points)
        cloud["intensity"] = random.uniform(0, 255, points)
        cloud["ring"] = np.arange(points) % 16
        cloud["t"] = np.linspace(0, 99_000_000, points).astype(np.uint32)
        clouds.append((START + k * 100_000_000, cloud))
    return clouds


def make_imu(count=50):
    random = np.random.default_rng(4)
    return [(START + k * 10_000_000, random.normal(0, 1, 3), random.normal(0, 1, 3) + [0, 0, 9.8])
            for k in range(count)]


CLOUDS, IMU = make_clouds(), make_imu()


def messages(store, ros1=False):
    """[(topic, message, log time)] in the order of time"""
    types = store.types

    def make(type_, /, **values):
        return types[type_](**values)

    def header(stamp, frame):
        time = make("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
        extra = {"seq": 0} if ros1 else {}
        return make("std_msgs/msg/Header", stamp=time, frame_id=frame, **extra)

    def vector(v):
        return make("geometry_msgs/msg/Vector3", x=float(v[0]), y=float(v[1]), z=float(v[2]))

    still = make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    out = []
    placed = [make("geometry_msgs/msg/TransformStamped", header=header(START, "base_link"),
                   child_frame_id=frame,
                   transform=make("geometry_msgs/msg/Transform", translation=vector(place),
                                  rotation=still))
              for frame, place in (("velodyne", (0, 0, 1.5)), ("imu_link", (0.1, 0, 1.4)))]
    out.append(("/tf_static", make("tf2_msgs/msg/TFMessage", transforms=placed), START - 1))
    status = make("sensor_msgs/msg/NavSatStatus", status=0, service=1)
    out.append(("/fix", make("sensor_msgs/msg/NavSatFix", header=header(START, "gps"),
                             status=status, latitude=47.5, longitude=8.25, altitude=512.0,
                             position_covariance=np.zeros(9), position_covariance_type=0), START))
    for stamp, rate, force in IMU:
        imu = make("sensor_msgs/msg/Imu", header=header(stamp, "imu_link"), orientation=still,
                   orientation_covariance=np.array([-1.0] + [0.0] * 8),
                   angular_velocity=vector(rate), angular_velocity_covariance=np.zeros(9),
                   linear_acceleration=vector(force), linear_acceleration_covariance=np.zeros(9))
        out.append(("/imu", imu, stamp + 1_000_000))
    for stamp, cloud in CLOUDS:
        fields = [make("sensor_msgs/msg/PointField", name=name, offset=POINT.fields[name][1],
                       datatype=FIELD_TYPES.get(name, 7), count=1)
                  for name in POINT.names if name != "pad"]
        message = make("sensor_msgs/msg/PointCloud2", header=header(stamp, "velodyne"), height=1,
                       width=len(cloud), fields=fields, is_bigendian=False,
                       point_step=POINT.itemsize, row_step=cloud.nbytes,
                       data=np.frombuffer(cloud.tobytes(), np.uint8), is_dense=True)
        out.append(("/points", message, stamp + 105_000_000))
    return sorted(out, key=lambda entry: entry[2])


def write_bag1(path, compression):
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms",
                                      "tf2_msgs/msg/TFMessage"))
    writer = Bag1(path)
    if compression:
        writer.set_compression(compression)
    with writer:
        topics = {name: writer.add_connection(name, type_, typestore=store)
                  for name, type_ in TYPES.items()}
        for topic, message, time in messages(store, ros1=True):
            writer.write(topics[topic], time, store.serialize_ros1(message, TYPES[topic]))


def write_bag2(path, storage, compression=None):
    store = get_typestore(Stores.ROS2_HUMBLE)
    writer = Bag2(path, version=8, storage_plugin=storage)
    if compression is not None:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        topics = {name: writer.add_connection(name, type_, typestore=store)
                  for name, type_ in TYPES.items()}
        for topic, message, time in messages(store):
            writer.write(topics[topic], time, store.serialize_cdr(message, TYPES[topic]))


def write_mcap(path, **options):
    """With the mcap package, from dictionaries as its ROS 2 writer takes them."""
    store = get_typestore(Stores.ROS2_HUMBLE)

    def plain(value):
        if isinstance(value, np.ndarray):
            return value.tobytes() if value.dtype == np.uint8 else value.tolist()
        if isinstance(value, list):
            return [plain(each) for each in value]
        if hasattr(value, "__dataclass_fields__"):
            return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__
                    if name != "__msgtype__"}
        return value

    with open(path, "wb") as file:
        writer = McapWriter(file, **options)
        schemas = {type_: writer.register_msgdef(type_.replace("/msg/", "/"),
                                                 store.generate_msgdef(type_, ros_version=2)[0])
                   for type_ in TYPES.values()}
        for topic, message, time in messages(store):
            writer.write_message(topic=topic, schema=schemas[TYPES[topic]],
                                 message=plain(message), log_time=time, publish_time=time)
        writer.finish()


def write_plain_mcap(path, **options):
    """With the mcap package's own writer, which also leaves out chunks and indexes."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    with open(path, "wb") as file:
        writer = PlainMcapWriter(file, **options)
        writer.start(profile="ros2", library="")
        channels = {}
        for topic, type_ in TYPES.items():
            text = store.generate_msgdef(type_, ros_version=2)[0]
            schema = writer.register_schema(type_, "ros2msg", text.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        for topic, message, time in messages(store):
            writer.add_message(channels[topic], time, store.serialize_cdr(message, TYPES[topic]),
                               time)
        writer.finish()


def read_here(path, folder):
    scans = read_scans(path)
    check(len(scans) == len(CLOUDS), f"{path.name}: {len(scans)} scans of {len(CLOUDS)}")
    for (stamp, points), (true_stamp, cloud) in zip(scans, CLOUDS):
        check(stamp == true_stamp, f"{path.name}: stamp {stamp}, written {true_stamp}")
        for name in ("x", "y", "z", "intensity", "t", "ring"):
            check(np.array_equal(points[name], cloud[name]), f"{path.name}: {name} differs")
    program = os.environ["UNDERSTORY_PROGRAM"]
    subprocess.run([program, "--quiet", "convert", path, folder], check=True)
    rows = np.genfromtxt(folder / "imu.csv", delimiter=",", skip_header=1)
    expected = np.array([np.concatenate([rate, force]) for _, rate, force in IMU])
    check(np.array_equal(rows[:, 1:], expected), f"{path.name}: IMU values differ")
    info = subprocess.run([program, "info", "--json", path], check=True, capture_output=True,
                          text=True).stdout
    check('"body_frame": "base_link"' in info, f"{path.name}: extrinsics not found")
    print(f"{path.name}: read as written")


def check_cloud(message, k, what):
    stamp, cloud = CLOUDS[k]
    time = message.header.stamp
    check(time.sec * 10**9 + time.nanosec == stamp, f"{what}: stamp differs")
    dtype = np.dtype({"names": [f.name for f in message.fields],
                      "formats": [{2: "u1", 4: "<u2", 6: "<u4", 7: "<f4"}[f.datatype]
                                  for f in message.fields],
                      "offsets": [f.offset for f in message.fields],
                      "itemsize": message.point_step})
    points = np.frombuffer(bytes(message.data), dtype)
    for name in ("x", "y", "z", "intensity", "t", "ring"):
        check(np.array_equal(points[name], cloud[name]), f"{what}: {name} differs")


def check_imu(message, k, what):
    _, rate, force = IMU[k]
    v, a = message.angular_velocity, message.linear_acceleration
    check([v.x, v.y, v.z, a.x, a.y, a.z] == [*rate, *force], f"{what}: IMU values differ")


def read_there(path):
    counts = {}

    def take(topic, message, what):
        k = counts.get(topic, 0)
        counts[topic] = k + 1
        if topic == "/lidar":
            check_cloud(message, k, what)
        if topic == "/imu":
            check_imu(message, k, what)
        if topic == "/gnss":
            check((message.latitude, message.longitude, message.altitude) == (47.5, 8.25, 512.0),
                  f"{what}: fix differs")

    expected = {"/tf_static": 1, "/gnss": 1, "/gnss/quality": 1, "/imu": len(IMU),
                "/lidar": len(CLOUDS)}
    with open(path, "rb") as file:
        records = list(StreamReader(file, validate_crcs=True).records)
        check(len(records) > 20, f"{path.name}: records")
        file.seek(0)
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        statistics = reader.get_summary().statistics
        check(statistics.message_count == sum(expected.values()), f"{path.name}: statistics")
        for _, channel, _, message in reader.iter_decoded_messages():
            take(channel.topic, message, f"mcap reading {path.name}")
    check(counts == expected, f"mcap reading {path.name}: {counts}")
    counts.clear()
    with AnyReader([path]) as reader:
        for connection, _, raw in reader.messages():
            take(connection.topic, reader.deserialize(raw, connection.msgtype),
                 f"rosbags reading {path.name}")
    check(counts == expected, f"rosbags reading {path.name}: {counts}")
    print(f"{path.name}: read by mcap and rosbags")


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        theirs = []
        for compression in (None, Bag1.CompressionFormat.BZ2, Bag1.CompressionFormat.LZ4):
            path = folder / f"{compression.name.lower() if compression else 'plain'}.bag"
            write_bag1(path, compression)
            theirs.append(path)
        for storage in (StoragePlugin.SQLITE3, StoragePlugin.MCAP):
            for mode in (None, CompressionMode.FILE, CompressionMode.MESSAGE):
                if storage == StoragePlugin.MCAP and mode == CompressionMode.MESSAGE:
                    continue  # MCAP compresses chunks instead
                path = folder / f"{storage.name.lower()}_{mode.name.lower() if mode else 'plain'}"
                write_bag2(path, storage, mode)
                theirs.append(path)
        for compression in CompressionType:
            path = folder / f"mcap_{compression.name.lower()}.mcap"
            write_mcap(path, compression=compression, chunk_size=20_000)
            theirs.append(path)
        write_plain_mcap(folder / "unchunked.mcap", use_chunking=False)
        write_plain_mcap(folder / "unindexed.mcap", index_types=IndexType.NONE, use_statistics=False,
                         use_summary_offsets=False, chunk_size=20_000)
        theirs += [folder / "unchunked.mcap", folder / "unindexed.mcap"]
        for path in theirs:
            read_here(path, folder / f"{path.name}.clouds")
        for compression in ("none", "lz4", "zstd"):
            ours = folder / f"ours_{compression}.mcap"
            subprocess.run([os.environ["UNDERSTORY_PROGRAM"], "--quiet", "convert",
                            folder / "plain.bag", ours, "--compression", compression], check=True)
            read_there(ours)


main()
