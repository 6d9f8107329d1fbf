"""Packets of a Mid-360 laid out by the maker's own header, against what is read of them.

The package py-livox2 brings livox_lidar_def.h of Livox SDK2. Its packed structs say where each number stands, and their
comments in which unit. Packets of random points are written by them, in all three forms, and read by this project.
Without the package the test is skipped: it is not among those that tests install, since it holds numpy back.
"""

import importlib.metadata
import pathlib
import re
import struct
import sys
import tempfile

import numpy as np

from scans import check, read_scans, xyz

FORMAT = {"uint8_t": "B", "uint16_t": "H", "uint32_t": "I", "int16_t": "h", "int32_t": "i", "float": "f"}
START_NS = 1_700_000_000_000_000_000
PACKETS, DOTS, GAP_NS = 208, 96, 480_000


def header():
    try:
        files = importlib.metadata.files("py-livox2") or []
    except importlib.metadata.PackageNotFoundError:
        files = []
    for file in files:
        if file.name == "livox_lidar_def.h":
            return pathlib.Path(file.locate()).read_text()
    print("skipped: py-livox2 is not installed")
    sys.exit(77)


def layout(text, name):
    """Format and names of the fields of a packed struct, but for the one byte that stands for the data behind it."""
    body = re.search(r"typedef struct \{([^}]*)\}\s*" + name + r";", text).group(1)
    form, names = "<", []
    for kind, field, many in re.findall(r"(\w+)\s+(\w+)(?:\[(\d+)\])?;", body):
        if field == "data":
            continue
        form += (many or "") + ("s" if many else FORMAT[kind])
        names.append(field)
    return struct.Struct(form), names


def packed(text, name, **values):
    form, names = layout(text, name)
    check(set(values) <= set(names), f"{name} has no {set(values) - set(names)}")
    return form.pack(*(values.get(field, b"" if kind.endswith("s") else 0)
                       for field, kind in zip(names, re.findall(r"\d*[a-zA-Z]", form.format[1:]))))


def datagram(payload):
    udp = struct.pack(">HHHH", 56300, 56301, 8 + len(payload), 0) + payload
    ip = struct.pack(">BBHHHBBH4B4B", 0x45, 0, 20 + len(udp), 0, 0, 64, 17, 0, 192, 168, 1, 12, 192, 168, 1, 5) + udp
    return bytes(12) + b"\x08\x00" + ip


def capture(file, packets):
    with open(file, "wb") as out:
        out.write(struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, 1))
        for time, payload in packets:
            frame = datagram(payload)
            out.write(struct.pack("<IIII", time // 1_000_000_000, time % 1_000_000_000, len(frame), len(frame)) + frame)


def point_of(text, kind, place, reflectivity, tag):
    """Bytes of a point (metres), and where its numbers put it."""
    if kind == 3:
        depth = round(np.linalg.norm(place) * 1000)
        theta = round(np.degrees(np.arccos(place[2] / np.linalg.norm(place))) * 100)
        phi = round(np.degrees(np.arctan2(place[1], place[0])) * 100) % 36000
        raw = packed(text, "LivoxLidarSpherPoint", depth=depth, theta=theta, phi=phi, reflectivity=reflectivity, tag=tag)
        t, p, d = np.radians(theta / 100), np.radians(phi / 100), depth / 1000
        return raw, (d * np.sin(t) * np.cos(p), d * np.sin(t) * np.sin(p), d * np.cos(t))
    name, unit = ("LivoxLidarCartesianHighRawPoint", 0.001) if kind == 1 else ("LivoxLidarCartesianLowRawPoint", 0.01)
    whole = [round(value / unit) for value in place]
    raw = packed(text, name, **dict(zip("xyz", whole)), reflectivity=reflectivity, tag=tag)
    return raw, [unit * value for value in whole]


text = header()
random = np.random.default_rng(3)
for kind, resolution in ((1, 1e-3), (2, 1e-2), (3, 1e-3)):
    packets, expected = [], []
    for number in range(PACKETS):
        data = b""
        for _ in range(DOTS):
            place = random.uniform(2.0, 30.0) * (lambda v: v / np.linalg.norm(v))(random.normal(size=3))
            reflectivity = int(random.integers(1, 255))
            raw, at = point_of(text, kind, place, reflectivity, 0)
            data += raw
            expected.append((*at, reflectivity))
        time = START_NS + number * GAP_NS
        head = packed(text, "LivoxLidarEthernetPacket", version=0, length=36 + len(data), time_interval=GAP_NS // 100,
                      dot_num=DOTS, udp_cnt=number, frame_cnt=0, data_type=kind, time_type=1, timestamp=struct.pack("<Q", time))
        packets.append((time, head + data))
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "mid360.pcap"
        capture(file, packets)
        scans = read_scans(file)
    ours = np.concatenate([np.column_stack([xyz(points), points["intensity"]]) for _, points in scans])
    expected = np.array(expected)
    check(len(ours) == len(expected), f"form {kind}: {len(ours)} of {len(expected)} points")
    off = np.abs(ours[:, :3] - expected[:, :3]).max()
    check(off < 0.01 * resolution + 4e-6, f"form {kind}: a point lies {off} m elsewhere")
    check((ours[:, 3] == expected[:, 3]).all(), f"form {kind}: reflectivities differ")
    times = np.concatenate([stamp + points["t"].astype(np.int64) for stamp, points in scans])
    wanted = START_NS + np.arange(PACKETS)[:, None] * GAP_NS + np.arange(DOTS)[None] * (GAP_NS / DOTS)
    check(np.abs(times - wanted.ravel()).max() <= GAP_NS / DOTS, f"form {kind}: times are {np.abs(times - wanted.ravel()).max()} ns off")
    print(f"form {kind}: {len(ours)} points in {len(scans)} scans, at most {1e3 * off:.4f} mm apart")
