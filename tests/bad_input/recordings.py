"""Recordings as lists of messages that a test can spoil, with writers for the formats that are read.
They are MCAP, ROS 1 bag, ROS 2 bag (.db3) and a capture of Velodyne packets. The standard library
only."""

import dataclasses
import math
import sqlite3
import struct

MCAP_MAGIC = b"\x89MCAP0\r\n"
NS = 1_000_000_000


@dataclasses.dataclass
class Message:
    topic: str
    type: str
    time: int  # log time, ns
    data: bytes  # CDR

    @property
    def stamp(self):
        return struct.unpack_from("<i", self.data, 4)[0] * NS + struct.unpack_from("<I", self.data, 8)[0]

    def at(self, stamp):
        data = bytearray(self.data)
        struct.pack_into("<iI", data, 4, stamp // NS, stamp % NS)
        return dataclasses.replace(self, time=self.time + stamp - self.stamp, data=bytes(data))

    def stamped(self, stamp):
        """The stamp alone, as of a sensor whose clock is off: it still arrives when it did."""
        return dataclasses.replace(self.at(stamp), time=self.time)


def late_imu(messages, offset_s, seconds):
    """The first seconds of a recording. The stamps of its IMU are late by the offset."""
    begin, late = min(message.time for message in messages), round(1e9 * offset_s)
    return [message.stamped(message.stamp + late) if message.topic == "/imu" else message
            for message in messages if message.time < begin + 1e9 * seconds]


class Cdr:
    """A reader of little-endian CDR that knows where each value lies."""

    def __init__(self, data):
        self.data, self.pos = data, 4

    def take(self, kind, count=1):
        size = struct.calcsize("<" + kind)
        self.pos += -(self.pos - 4) % size
        where = self.pos
        values = struct.unpack_from(f"<{count}{kind}", self.data, where)
        self.pos += size * count
        return where, values if count > 1 else values[0]

    def text(self):
        length = self.take("I")[1]
        self.pos += length
        return self.data[self.pos - length : self.pos - 1].decode()


class Cloud:
    """A PointCloud2 message; `points` is a bytearray of `step` bytes a point."""

    def __init__(self, data):
        cdr = Cdr(data)
        self.stamp, self.frame = cdr.take("I", 2)[1], cdr.text()
        self.height, self.width = cdr.take("I", 2)[1]
        self.fields = {}
        for _ in range(cdr.take("I")[1]):
            name = cdr.text()
            offset, kind = cdr.take("I")[1], cdr.take("B")[1]
            self.fields[name] = (offset, kind, cdr.take("I")[1])
        cdr.take("B")
        self.step = cdr.take("I")[1]
        cdr.take("I")
        length = cdr.take("I")[1]
        self.points = bytearray(data[cdr.pos : cdr.pos + length])

    def __len__(self):
        return len(self.points) // self.step

    def put(self, i, name, kind, *values):
        struct.pack_into("<" + kind, self.points, i * self.step + self.fields[name][0], *values)

    def without(self, name):
        del self.fields[name]

    def cdr(self):
        out = bytearray(b"\0\1\0\0")

        def put(kind, *values):
            out.extend(bytes(-(len(out) - 4) % struct.calcsize("<" + kind)))
            out.extend(struct.pack(f"<{len(values)}{kind}", *values))

        def text(value):
            put("I", len(value) + 1)
            out.extend(value.encode() + b"\0")

        put("I", *self.stamp)
        text(self.frame)
        put("I", 1, len(self))
        put("I", len(self.fields))
        for name, (offset, kind, count) in self.fields.items():
            text(name)
            put("I", offset)
            put("B", kind)
            put("I", count)
        put("B", 0)
        put("I", self.step, len(self.points), len(self.points))
        out.extend(self.points)
        put("B", 1)
        return bytes(out)

    def ros1(self):
        def text(value):
            return struct.pack("<I", len(value)) + value.encode()

        out = struct.pack("<III", 0, *self.stamp) + text(self.frame)
        out += struct.pack("<III", 1, len(self), len(self.fields))
        for name, (offset, kind, count) in self.fields.items():
            out += text(name) + struct.pack("<IBI", offset, kind, count)
        out += struct.pack("<BII", 0, self.step, len(self.points))
        return out + struct.pack("<I", len(self.points)) + bytes(self.points) + b"\1"


def edit_cloud(message, change):
    """The message with `change(cloud)` applied to its points."""
    cloud = Cloud(message.data)
    change(cloud)
    return dataclasses.replace(message, data=cloud.cdr())


def edit_imu(message, change):
    """The message with (rates, forces) = change(rates, forces)."""
    cdr = Cdr(message.data)
    cdr.take("I", 2)
    cdr.text()
    cdr.take("d", 4 + 9)
    rates_at, rates = cdr.take("d", 3)
    cdr.take("d", 9)
    forces_at, forces = cdr.take("d", 3)
    rates, forces = change(rates, forces)
    data = bytearray(message.data)
    struct.pack_into("<3d", data, rates_at, *rates)
    struct.pack_into("<3d", data, forces_at, *forces)
    return dataclasses.replace(message, data=bytes(data))


def edit_fix(message, change):
    """The NavSatFix with (latitude, longitude, height, variances) = change of these: degrees, metres, nine m^2."""
    cdr = Cdr(message.data)
    cdr.take("I", 2)
    cdr.text()
    cdr.take("b")
    cdr.take("H")
    places_at, places = cdr.take("d", 3)
    variances_at, variances = cdr.take("d", 9)
    *places, variances = change(*places, variances)
    data = bytearray(message.data)
    struct.pack_into("<3d", data, places_at, *places)
    struct.pack_into("<9d", data, variances_at, *variances)
    return dataclasses.replace(message, data=bytes(data))


def _records(data, start, end):
    while start + 9 <= end:
        length = struct.unpack_from("<Q", data, start + 1)[0]
        yield data[start], data[start + 9 : start + 9 + length]
        start += 9 + length


def read_mcap(path):
    """All messages of a file with chunks that are not compressed."""
    data = path.read_bytes()
    schemas, channels, messages = {}, {}, []

    def text(content, at):
        length = struct.unpack_from("<I", content, at)[0]
        return content[at + 4 : at + 4 + length].decode(), at + 4 + length

    def take(opcode, content):
        if opcode == 3:
            schemas[struct.unpack_from("<H", content)[0]] = text(content, 2)[0]
        elif opcode == 4:
            number, schema = struct.unpack_from("<HH", content)
            channels[number] = (text(content, 4)[0], schemas[schema])
        elif opcode == 5:
            channel, _, time = struct.unpack_from("<HIQ", content)
            messages.append(Message(*channels[channel], time, content[22:]))
        elif opcode == 6:
            compression, at = text(content, 28)
            assert compression == "", compression
            for inner in _records(content, at + 8, len(content)):
                take(*inner)

    for opcode, content in _records(data, len(MCAP_MAGIC), len(data) - len(MCAP_MAGIC)):
        if opcode == 15:  # end of the data; the summary repeats what is known
            break
        take(opcode, content)
    return messages


def write_mcap(path, messages):
    """Without chunks and index, in the order given. Returns the byte at which each message begins."""
    places = []
    with open(path, "wb") as file:

        def record(opcode, content):
            file.write(struct.pack("<BQ", opcode, len(content)) + content)

        def text(value):
            return struct.pack("<I", len(value)) + value.encode()

        file.write(MCAP_MAGIC)
        record(1, text("") + text("test"))
        channels = {}
        for number, message in enumerate(messages):
            if message.topic not in channels:
                channels[message.topic] = len(channels) + 1
                id = struct.pack("<H", channels[message.topic])
                record(3, id + text(message.type) + text("ros2msg") + text(""))
                record(4, id + id + text(message.topic) + text("cdr") + text(""))
            places.append(file.tell())
            head = struct.pack("<HIQQ", channels[message.topic], number, message.time, message.time)
            record(5, head + message.data)
        record(15, struct.pack("<I", 0))
        record(2, struct.pack("<QQI", 0, 0, 0))
        file.write(MCAP_MAGIC)
    return places


def write_indexed_mcap(path, messages, chunk_bytes=1_000_000):
    """In chunks, with the index and the list of topics at the end that a recorder writes."""

    def text(value):
        return struct.pack("<I", len(value)) + value.encode()

    def record(opcode, content):
        return struct.pack("<BQ", opcode, len(content)) + content

    def listing(entries):
        return struct.pack("<I", len(entries)) + entries

    ids, about = {}, b""
    for message in messages:
        if message.topic not in ids:
            ids[message.topic] = len(ids) + 1
            id = struct.pack("<H", ids[message.topic])
            about += record(3, id + text(message.type) + text("ros2msg") + text(""))
            about += record(4, id + id + text(message.topic) + text("cdr") + text(""))
    with open(path, "wb") as file:
        file.write(MCAP_MAGIC + record(1, text("") + text("test")) + about)
        chunk, times, places, index = b"", [], {}, b""
        for number, message in enumerate(messages):
            id = ids[message.topic]
            places.setdefault(id, []).append((message.time, len(chunk)))
            chunk += record(5, struct.pack("<HIQQ", id, number, message.time, message.time) + message.data)
            times.append(message.time)
            if len(chunk) < chunk_bytes and number + 1 < len(messages):
                continue
            head = struct.pack("<QQQI", min(times), max(times), len(chunk), 0) + text("")
            at, whole = file.tell(), record(6, head + struct.pack("<Q", len(chunk)) + chunk)
            file.write(whole)
            offsets = b""
            for id, found in places.items():
                offsets += struct.pack("<HQ", id, file.tell())
                file.write(record(7, struct.pack("<H", id) + listing(b"".join(
                    struct.pack("<QQ", *each) for each in found))))
            index += record(8, struct.pack("<QQQQ", min(times), max(times), at, len(whole)) + listing(offsets)
                            + struct.pack("<Q", file.tell() - at - len(whole)) + text("")
                            + struct.pack("<QQ", len(chunk), len(chunk)))
            chunk, times, places = b"", [], {}
        file.write(record(15, struct.pack("<I", 0)))
        summary = file.tell()
        file.write(about + index + record(2, struct.pack("<QQI", summary, 0, 0)) + MCAP_MAGIC)


def _ros1(message):
    """The bytes of the same message in ROS 1."""
    if message.type.endswith("PointCloud2"):
        return Cloud(message.data).ros1()
    cdr = Cdr(message.data)
    if message.type.endswith("Imu"):
        stamp, frame = cdr.take("I", 2)[1], cdr.text()
        values = [v for count in (4, 9, 3, 9, 3, 9) for v in cdr.take("d", count)[1]]
        head = struct.pack("<III", 0, *stamp) + struct.pack("<I", len(frame)) + frame.encode()
        return head + struct.pack("<37d", *values)
    assert message.type.endswith("TFMessage"), message.type
    count = cdr.take("I")[1]
    out = struct.pack("<I", count)
    for _ in range(count):
        stamp = cdr.take("I", 2)[1]
        out += struct.pack("<III", 0, *stamp)
        for name in (cdr.text(), cdr.text()):
            out += struct.pack("<I", len(name)) + name.encode()
        out += struct.pack("<7d", *cdr.take("d", 7)[1])
    return out


def write_bag(path, messages, chunk_bytes=2_000_000, indexed=False):
    """A ROS 1 bag; without index as a recorder leaves it that was not closed."""

    def record(fields, data):
        header = b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k.encode() + b"=" + v
                          for k, v in fields.items())
        return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data

    def stamp(time):
        return struct.pack("<II", time // NS, time % NS)

    def head(place, chunks):
        return record({"op": b"\3", "index_pos": struct.pack("<Q", place),
                       "conn_count": struct.pack("<I", len(known)),
                       "chunk_count": struct.pack("<I", chunks)}, b" " * 4000)

    known, chunk, counts, index = {}, b"", {}, []
    with open(path, "wb") as file:
        file.write(b"#ROSBAG V2.0\n" + head(0, 0))
        for i, message in enumerate(messages):
            if message.topic not in known:
                id = struct.pack("<I", len(known))
                about = b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k + b"=" + v for k, v in (
                    (b"topic", message.topic.encode()), (b"md5sum", b"*"),
                    (b"type", message.type.replace("/msg/", "/").encode()),
                    (b"message_definition", b"")))
                known[message.topic] = (id, record({"op": b"\7", "topic": message.topic.encode(), "conn": id}, about))
                chunk += known[message.topic][1]
            id = known[message.topic][0]
            chunk += record({"op": b"\2", "conn": id, "time": stamp(message.time)}, _ros1(message))
            counts[id] = counts.get(id, 0) + 1
            if len(chunk) > chunk_bytes or i + 1 == len(messages):
                index.append(record({"op": b"\6", "ver": struct.pack("<I", 1), "start_time": stamp(message.time),
                                     "chunk_pos": struct.pack("<Q", file.tell()), "end_time": stamp(message.time),
                                     "count": struct.pack("<I", len(counts))},
                                    b"".join(id + struct.pack("<I", n) for id, n in counts.items())))
                file.write(record({"op": b"\5", "compression": b"none",
                                   "size": struct.pack("<I", len(chunk))}, chunk))
                chunk, counts = b"", {}
        if indexed:
            place = file.tell()
            file.write(b"".join(each for _, each in known.values()) + b"".join(index))
            file.seek(len(b"#ROSBAG V2.0\n"))
            file.write(head(place, len(index)))


def write_db3(path, messages):
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT "
                     "NULL, serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)")
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, "
                     "timestamp INTEGER NOT NULL, data BLOB NOT NULL)")
        base.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
        known = {}
        for message in messages:
            if message.topic not in known:
                known[message.topic] = len(known) + 1
                base.execute("INSERT INTO topics VALUES(?, ?, ?, 'cdr', '')",
                             (known[message.topic], message.topic, message.type))
            base.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)",
                         (known[message.topic], message.time, message.data))
    base.close()


LASER_NS, SEQUENCE_NS = 2304, 55296  # VLP-16: from laser to laser, from sequence to sequence


def write_capture(path, scans):
    """The scans of a simulated VLP-16 as the packets that it would have sent."""
    firings = {}  # sequence -> [azimuth of its first laser, {laser: (range, intensity)}]
    first = scans[0].stamp
    for message in scans:
        cloud = Cloud(message.data)
        offsets = [cloud.fields[name][0] for name in ("x", "intensity", "ring", "t")]
        since = message.stamp - first
        for at in range(0, len(cloud.points), cloud.step):
            x, y, z = struct.unpack_from("<3f", cloud.points, at + offsets[0])
            ring = struct.unpack_from("<H", cloud.points, at + offsets[2])[0]
            time = since + struct.unpack_from("<I", cloud.points, at + offsets[3])[0]
            laser = 2 * ring if ring < 8 else 2 * (ring - 8) + 1
            sequence = round((time - laser * LASER_NS) / SEQUENCE_NS)
            azimuth = -math.degrees(math.atan2(y, x)) - laser * LASER_NS * 360 / 1e8
            firing = firings.setdefault(sequence, [azimuth, {}])
            firing[1][laser] = (math.sqrt(x * x + y * y + z * z),
                                struct.unpack_from("<f", cloud.points, at + offsets[1])[0])
    with open(path, "wb") as file:
        file.write(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1))
        for begin in range(min(firings), max(firings) + 1, 24):
            time = first + begin * SEQUENCE_NS
            _write_packet(file, time, [firings.get(begin + i) for i in range(24)])


def _write_packet(file, time, firings):
    known = next(((i, f[0]) for i, f in enumerate(firings) if f is not None), (0, 0.0))
    payload = b""
    for block in range(12):
        azimuth = known[1] + (2 * block - known[0]) * SEQUENCE_NS * 360 / 1e8
        payload += struct.pack("<HH", 0xEEFF, round(azimuth * 100) % 36000)
        for firing in firings[2 * block : 2 * block + 2]:
            for laser in range(16):
                metres, intensity = firing[1].get(laser, (0.0, 0.0)) if firing else (0.0, 0.0)
                payload += struct.pack("<HB", round(metres / 0.002), min(255, round(intensity)))
    payload += struct.pack("<IBB", time // 1000 % 3_600_000_000, 0x37, 0x22)
    udp = struct.pack(">HHHH", 2368, 2368, 8 + len(payload), 0) + payload
    ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 0, 0, 64, 17, 0, b"\xc0\xa8\1\xc9",
                     b"\xff\xff\xff\xff")
    frame = b"\xff" * 6 + b"\x60\x76\x88\0\0\0" + b"\x08\0" + ip + udp
    micros = time // 1000
    file.write(struct.pack("<IIII", micros // 1_000_000, micros % 1_000_000, len(frame), len(frame)))
    file.write(frame)
