"""Packets of lidars as their makers' manuals lay them out, with random returns, and captures of them. A writer of its own:
nothing of it is shared with the readers."""

import dataclasses
import struct

import numpy as np

START_NS = 1_700_002_800 * 10**9  # 2023-11-14 23:00:00 UTC, the start of an hour


@dataclasses.dataclass
class Sensor:
    """How a sensor sends. `packet(i, random)`: the payload and its time in ns since START_NS."""
    name: str
    packets_per_s: float
    points_per_packet: int
    packet: object
    ports: tuple = (2368, 2368)  # from, to


def ranges(random, shape, low, high):
    """Distances in steps of the format; one in twenty without a return."""
    steps = random.integers(low, high, shape)
    return np.where(random.random(shape) < 0.05, 0, steps)


def velodyne(name, product, sequence_us, per_block, dual=False):
    """12 blocks of 32 returns; per_block firing sequences in a block (VLP-16: 2)."""
    turns = 6 if dual else 12
    block_us = sequence_us * per_block

    def packet(i, random):
        begin_us = i * turns * block_us
        blocks = b""
        for k in range(12):
            turn = k // 2 if dual else k
            azimuth = round((begin_us + turn * block_us) * 0.36) % 36000  # 10 turns a second
            returns = np.zeros(32, np.dtype([("d", "<u2"), ("i", "u1")]))
            returns["d"], returns["i"] = ranges(random, 32, 500, 40_000), random.integers(1, 256, 32)
            if dual:  # two returns of one range would be one
                returns["d"] = np.where(returns["d"] > 0, returns["d"] & 0xFFFE | k % 2, 0)
            blocks += struct.pack("<HH", 0xEEFF, azimuth) + returns.tobytes()
        us = round(begin_us)
        return blocks + struct.pack("<IBB", us % 3_600_000_000, 0x39 if dual else 0x37, product), us * 1000

    return Sensor(name, 1e6 / (turns * block_us), 12 * 32, packet)


def hesai(name, channels, blocks, block_us, dual=False):
    """PandarXT (0x0601), PandarQT64 (0x0301) and Pandar64, whose head tells channels and blocks alone."""
    old, qt = channels == 64 and blocks == 6, channels == 64 and blocks == 4
    firings = blocks // 2 if dual else blocks
    mode = 0x39 if dual else 0x37
    head = bytes([0xEE, 0xFF]) + (bytes([64, 6, 0, 4, 2, 1]) if old else
                                 bytes([3 if qt else 6, 1, 0, 0, channels, blocks, 0, 4, 2, 1]))
    kind = np.dtype([("d", "<u2"), ("i", "u1")] if old else [("d", "<u2"), ("i", "u1"), ("c", "u1")])

    def packet(i, random):
        ns = round(i * firings * block_us * 1000)
        data = head
        for k in range(blocks):
            firing = i * firings + (k // 2 if dual else k)
            returns = np.zeros(channels, kind)
            returns["d"], returns["i"] = ranges(random, channels, 200, 20_000), random.integers(1, 256, channels)
            data += struct.pack("<H", round(firing * block_us * 0.36) % 36000) + returns.tobytes()
        us, seconds = ns // 1000 % 1_000_000, ns // 10**9
        date = bytes([23 if old else 123, 11, 14, 23, seconds // 60, seconds % 60])
        if old or qt:
            data += bytes(8 if old else 10) + struct.pack("<HIBB", 600, us, mode, 0x42) + date
        else:
            data += bytes(10) + struct.pack("<BH", mode, 600) + date + struct.pack("<IB", us, 0x42)
        return data + struct.pack("<I", i), ns

    return Sensor(name, 1e6 / (firings * block_us), channels * blocks, packet, (10000, 2368))


def places(random, dots):
    """Points 2 to 60 m away in random directions, mm."""
    directions = random.normal(size=(dots, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return np.round(1000.0 * directions * random.uniform(2.0, 60.0, (dots, 1))).astype("<i4")


def cartesian(random, dots):
    points = np.zeros(dots, np.dtype([("p", "<i4", 3), ("r", "u1"), ("t", "u1")]))
    points["p"], points["r"] = places(random, dots), random.integers(1, 256, dots)
    return points.tobytes()


def mid_360():
    def packet(i, random):
        ns = i * 480_000
        return struct.pack("<BHHHHBBB", 0, 36 + 96 * 14, 4800, 96, i % 65536, 0, 1, 1) + bytes(16) \
            + struct.pack("<q", START_NS + ns) + cartesian(random, 96), ns

    return Sensor("Mid-360", 1e9 / 480_000, 96, packet, (56300, 56301))


def avia():
    def packet(i, random):
        ns = i * 400_000
        return bytes([5, 1, 1, 0, 0, 0, 0, 0, 1, 2]) + struct.pack("<q", START_NS + ns) + cartesian(random, 96), ns

    return Sensor("Avia", 2500, 96, packet, (65000, 56001))


def ouster():
    """RNG15_RFL8_NIR8 of a sensor with 128 beams and 1024 columns a turn, ten turns a second (its metadata lie beside)."""
    kind = np.dtype([("d", "<u2"), ("r", "u1"), ("n", "u1")])

    def packet(i, random):
        data = struct.pack("<HH", 1, i // 64 % 65536) + bytes(28)
        for k in range(16):
            column = i * 16 + k
            pixels = np.zeros(128, kind)
            pixels["d"], pixels["r"] = ranges(random, 128, 200, 8_000), random.integers(1, 256, 128)
            data += struct.pack("<QHH", START_NS + column * 10**8 // 1024, column % 1024, 1) + pixels.tobytes()
        return data + bytes(32), i * 16 * 10**8 // 1024

    return Sensor("OS-1-128, 1024 x 10", 640, 16 * 128, packet, (7502, 7502))


SENSORS = [
    velodyne("VLP-16", 0x22, 55.296, 2), velodyne("VLP-16, dual", 0x22, 55.296, 2, dual=True),
    velodyne("HDL-32E", 0x21, 46.08, 1), velodyne("VLP-32C", 0x28, 55.296, 1),
    hesai("PandarXT-32", 32, 8, 50.0), hesai("PandarXT-32, dual", 32, 8, 50.0, dual=True),
    hesai("PandarXT-16", 16, 8, 50.0), hesai("Pandar64", 64, 6, 55.56), hesai("PandarQT64", 64, 4, 500.0 / 3.0),
    mid_360(), avia()]


def datagram(stamp_ns, ports, payload, device=1):
    """A record of a .pcap with times in ns; the link address of the sensor ends with `device`."""
    udp = struct.pack(">HHHH", *ports, 8 + len(payload), 0) + payload
    ip = bytes([0x45, 0]) + struct.pack(">HHHBBH", 20 + len(udp), 1, 0, 64, 17, 0) \
        + bytes([192, 168, 1, 201, 192, 168, 1, 1]) + udp
    frame = bytes(6) + bytes([2, 0, 0, 0, 0, device]) + b"\x08\x00" + ip
    return struct.pack("<IIII", stamp_ns // 10**9, stamp_ns % 10**9, len(frame), len(frame)) + frame


HEAD = struct.pack("<IHHQII", 0xA1B23C4D, 2, 4, 0, 65535, 1)


def write_capture(file, sensor, seconds, seed=3):
    """All packets of some seconds; returns their number."""
    random = np.random.default_rng(seed)
    count = round(seconds * sensor.packets_per_s)
    with open(file, "wb") as out:
        out.write(HEAD)
        for i in range(count):
            payload, ns = sensor.packet(i, random)
            out.write(datagram(START_NS + ns, sensor.ports, payload))
    return count
