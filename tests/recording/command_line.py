"""What `understory info` and `understory convert` answer to good and bad recordings: exit codes,
messages that name the file, and what is kept of damaged ones."""

import json
import os
import pathlib
import resource
import struct
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "bad_input"))
from recordings import read_mcap, write_mcap  # noqa: E402: found by the line above

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
SAMPLES = pathlib.Path(__file__).resolve().parents[2] / "fuzz" / "corpus"


def run(*arguments, **options):
    done = subprocess.run([PROGRAM, "--quiet", *map(str, arguments)], capture_output=True,
                          text=True, **options)
    return done.returncode, done.stdout, done.stderr


def info(path):
    code, out, errors = run("info", "--json", path)
    assert code == 0, (path, code, errors)
    return json.loads(out)


def check_samples(folder):
    for sample in ("rosbag/small_none.bag", "rosbag/small_bz2.bag", "rosbag/small_lz4.bag",
                   "db3/small.db3", "mcap/small_plain.mcap"):
        first = info(SAMPLES / sample)
        assert first["lidar"]["scans"] == 3 and first["imu"]["samples"] == 15, sample
        assert first["gnss"]["fixes"] == 1 and first["warnings"] == [], sample
        conventions = {t["role"]: t["conventions"] for t in first["topics"]}
        assert "offset in s from the header stamp" in conventions["lidar"], conventions
        # Through every output and back, the counts stay.
        for out, options in (("x.mcap", ()), ("lz4.mcap", ("--compression", "lz4")), ("pcd", ()),
                             ("ply", ("--format", "ply"))):
            target = folder / f"{sample.replace('/', '_')}_{out}"
            code, _, errors = run("convert", SAMPLES / sample, target, *options)
            assert code == 0, errors
            again = info(target)
            for kind, count in (("lidar", "scans"), ("lidar", "points"), ("imu", "samples"),
                                ("gnss", "fixes")):
                assert again[kind][count] == first[kind][count], (target, kind, count)
            assert abs(again["duration_s"] - first["duration_s"]) < 1e-6, target


def datagram(stamp_ns, source_port, port, payload, device=0):
    """A record of a .pcap; the link address of the sensor ends with `device`"""
    udp = struct.pack(">HHHH", source_port, port, 8 + len(payload), 0) + payload
    ip = bytes([0x45, 0]) + struct.pack(">HHHBBH", 20 + len(udp), 1, 0, 64, 17, 0) \
        + bytes([192, 168, 1, 201, 192, 168, 1, 1]) + udp
    frame = bytes(11) + bytes([device]) + b"\x08\x00" + ip
    return struct.pack("<IIII", stamp_ns // 10**9, stamp_ns % 10**9 // 1000, len(frame),
                       len(frame)) + frame


def hesai_packet(i):
    """Of a PandarXT-32 that turns ten times a second, 2023-11-14 22:13:20 + 0.4 ms i"""
    blocks = b"".join(struct.pack("<H", (144 * i + 18 * b) % 36000)
                      + struct.pack("<HBB", 2500, 9, 0) * 32 for b in range(8))
    return bytes([0xEE, 0xFF, 6, 1, 0, 0, 32, 8, 0, 4, 2, 1]) + blocks + bytes(10) + b"\x37" \
        + struct.pack("<H", 600) + bytes([123, 11, 14, 22, 13, 20]) \
        + struct.pack("<I", 400 * i) + b"\x42" + struct.pack("<I", i)


def velodyne_packet(i):
    """Of a VLP-16 that turns ten times a second, 1.327 ms each"""
    blocks = b"".join(struct.pack("<HH", 0xEEFF, round(47.77 * i * 10 + 39.8 * b) % 36000)
                      + struct.pack("<HB", 2500, 9) * 32 for b in range(12))
    return blocks + struct.pack("<IBB", 800_000_000 + 1327 * i, 0x37, 0x22)


def velodyne_capture(folder, packets):
    start = 1_700_000_000 * 10**9
    file = folder / "velodyne.pcap"
    file.write_bytes(struct.pack("<IHHQII", 0xA1B2C3D4, 2, 4, 0, 65535, 1) + b"".join(
        datagram(start + 1_327_000 * i, 2368, 2368, data) for i, data in enumerate(packets)))
    return file


def livox_packet(i, imu=False):
    """Of a Mid-360, 0.48 ms each"""
    data = struct.pack("<6f", 0, 0, 0.1, 0, 0, 1) if imu else \
        struct.pack("<iiiBB", 3000, -500, 700, 20, 0) * 96
    return struct.pack("<BHHHHBBB", 0, 36 + len(data), 4800, 1 if imu else 96, i, 0,
                       0 if imu else 1, 1) + bytes(16) \
        + struct.pack("<q", 1_700_000_000 * 10**9 + 480_000 * i) + data


def check_captures(folder):
    start = 1_700_000_000 * 10**9
    head = struct.pack("<IHHQII", 0xA1B2C3D4, 2, 4, 0, 65535, 1)
    hesai, livox, other = (folder / name for name in ("hesai.pcap", "livox.pcap", "other.pcap"))
    hesai.write_bytes(head + b"".join(datagram(start + 400_000 * i, 10000, 2368, hesai_packet(i))
                                      for i in range(750)))
    livox.write_bytes(head + b"".join(
        datagram(start + 480_000 * i, 56300, 56301, livox_packet(i))
        + datagram(start + 480_000 * i, 56400, 56401, livox_packet(i, imu=True))
        for i in range(650)))
    other.write_bytes(head + datagram(start, 6699, 6699, b"\x55\xAA\x05" + bytes(1245)) * 50)
    first = info(hesai)
    assert first["lidar"]["scans"] == 3 and first["lidar"]["rings"] == 32, first["lidar"]
    assert any("angle correction" in each for each in first["warnings"]), first["warnings"]
    # With the sensor's own file nothing is to be warned of but the IMU that is not there.
    angles = folder / "hesai_angles.csv"
    angles.write_text("Channel,Elevation,Azimuth\n" + "".join(f"{i},{16 - i},0.1\n"
                                                              for i in range(1, 33)))
    assert len(info(hesai)["warnings"]) == 1, info(hesai)["warnings"]
    angles.write_text("Channel,Elevation,Azimuth\n1,0,0\n")
    code, _, errors = run("info", hesai)
    assert code == 3 and "hesai_angles.csv" in errors and "1 channels" in errors, errors
    angles.write_text("Channel,Elevation,Azimuth\n1,0\n")
    code, _, errors = run("info", hesai, "--metadata", angles)
    assert code == 3 and "line 2" in errors, errors
    angles.unlink()
    mid = info(livox)
    assert mid["lidar"]["model"] == "Mid-360" and mid["imu"]["samples"] == 650, mid
    assert mid["lidar"]["scans"] == 4 and mid["lidar"]["rings"] == 0, mid["lidar"]
    for recording, seen in ((hesai, first), (livox, mid)):
        target = folder / (recording.stem + ".mcap")
        assert run("convert", recording, target)[0] == 0
        again = info(target)
        for kind, count in (("lidar", "scans"), ("lidar", "points"), ("lidar", "rings"), ("imu", "samples")):
            assert again[kind][count] == seen[kind][count], (recording, kind, count)
    code, _, errors = run("info", other)
    assert code == 3 and "RoboSense" in errors and "PointCloud2" in errors, errors


def check_bad_captures(folder):
    """Packets that are cut, doubled, of two sensors of one address on one port, of an unknown firmware"""
    start = 1_700_000_000 * 10**9
    head = struct.pack("<IHHQII", 0xA1B2C3D4, 2, 4, 0, 65535, 1)

    def capture(name, packets):
        file = folder / name
        file.write_bytes(head + b"".join(datagram(start + 400_000 * i, 10000, 2368, data, device)
                                         for i, device, data in packets))
        return file

    whole = [(i, 1, hesai_packet(i)) for i in range(750)]
    points = info(capture("whole.pcap", whole))["lidar"]["points"]
    cut = info(capture("cut.pcap", [(i, d, data[:500] if i == 300 else data) for i, d, data in whole]))
    assert cut["lidar"]["points"] == points - 256, cut["lidar"]
    assert any("has 500 bytes, expected 1080" in each for each in cut["warnings"]), cut["warnings"]
    doubled = info(capture("doubled.pcap", [each for each in whole for _ in range(1 + (each[0] == 300))]))
    assert doubled["lidar"]["points"] == points, doubled["lidar"]
    assert any("comes twice" in each for each in doubled["warnings"]), doubled["warnings"]
    strange = [(i, d, data[:2] + bytes([9, 7]) + data[4:]) for i, d, data in whole]
    code, _, errors = run("info", capture("strange.pcap", strange))
    assert code == 3 and "another Hesai (protocol 9.7" in errors and "PointCloud2" in errors, errors
    velodyne = [velodyne_packet(i) for i in range(400)]
    points = info(velodyne_capture(folder, velodyne))["lidar"]["points"]
    cut = info(velodyne_capture(folder, velodyne[:200] + [velodyne[200][:700]] + velodyne[201:]))
    assert cut["lidar"]["points"] == points - 384, cut["lidar"]
    assert any("has 700 bytes, expected 1206" in each for each in cut["warnings"]), cut["warnings"]
    doubled = info(velodyne_capture(folder, velodyne[:200] + [velodyne[200]] + velodyne[200:]))
    assert doubled["lidar"]["points"] == points, doubled["lidar"]
    assert any("comes twice" in each for each in doubled["warnings"]), doubled["warnings"]
    code, _, errors = run("info", velodyne_capture(folder, [each[:-1] + b"\x99" for each in velodyne]))
    assert code == 3 and "a Velodyne of unknown product 153" in errors and "PointCloud2" in errors, errors
    unknown = folder / "livox9.pcap"
    unknown.write_bytes(head + b"".join(
        datagram(start + 480_000 * i, 56300, 56301, b"\x09" + livox_packet(i)[1:]) for i in range(100)))
    code, _, errors = run("info", unknown)
    assert code == 3 and "a Livox of unknown version 9" in errors and "PointCloud2" in errors, errors
    points = info(folder / "whole.pcap")["lidar"]["points"]
    both = capture("both.pcap", [each for i in range(750) for each in ((i, 1, hesai_packet(i)), (i, 2, hesai_packet(i)))])
    seen = info(both)
    assert seen["lidar"]["points"] == points, seen["lidar"]
    names = [f"udp 2368 from 192.168.1.201 (00:00:00:00:00:0{device})" for device in (1, 2)]
    assert {each["name"] for each in seen["topics"]} == set(names), seen["topics"]
    assert any(f"packets of 2 lidars; only those of {names[0]}" in each for each in seen["warnings"]), seen["warnings"]
    code, out, errors = run("info", "--json", both, "--lidar-topic", names[1])
    assert code == 0 and json.loads(out)["lidar"]["points"] == points, errors
    rig = folder / "both.yaml"
    rig.write_text("body_frame: base\nlidars:\n" + "".join(
        f'  - {{topic: "{name}", body_from_lidar: {{translation_m: [{i}, 0, 0]}}}}\n' for i, name in enumerate(names)))
    code, out, errors = run("info", "--json", both, "--extrinsics", rig)
    merged = json.loads(out)["lidar"]["points"]
    assert code == 0 and merged == 2 * points, (merged, points, errors)
    further = json.loads(out)["rig"]["body_from_further_lidars"]
    assert [lidar["translation_m"] for lidar in further] == [[1, 0, 0]], further
    code, out, errors = run("info", both, "--extrinsics", rig)
    assert "body_from_lidar 2: (1.0000, 0.0000, 0.0000) m" in out, out


def check_refusals(folder):
    empty = folder / "empty.mcap"
    empty.touch()
    text = folder / "text.bag"
    text.write_text("no recording\n" * 100)
    for path in (folder / "missing.mcap", empty, text, folder / "none"):
        code, _, errors = run("info", path)
        assert code == 3 and str(path) in errors, (path, code, errors)
    sample = SAMPLES / "rosbag" / "small_none.bag"
    code, _, errors = run("convert", sample, folder / "no" / "such" / "x.mcap")
    assert code == 3 and "x.mcap" in errors, errors
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))
    for name in ("full.mcap", "full clouds", "full.csv.gz"):
        code, _, errors = run("convert", sample, folder / name, preexec_fn=limit)
        assert code == 3 and not list(folder.glob("*full*")), (code, errors)
        if name != "full.csv.gz":  # these scans have no stems
            assert f"{folder / name}" in errors and "too large" in errors.lower(), errors
    copy = folder / "same.mcap"
    assert run("convert", sample, copy)[0] == 0
    before = copy.read_bytes()
    assert run("convert", copy, copy)[0] == 3
    assert copy.read_bytes() == before
    code, _, errors = run("info", sample, "--lidar-topic", "/nothing")
    assert code == 3 and "/points" in errors, errors
    assert run("convert", sample)[0] == 2
    for name in ("x.stems.csv", "x.pcap", "x.laz"):
        code, _, errors = run("convert", sample, folder / name)
        assert code == 2 and ".csv.gz" in errors and not (folder / name).exists(), (code, errors)
        code, _, errors = run("simulate", "demo", "--duration-s", 1, "-o", folder / name.replace("pcap", "bag"))
        assert code == 2 and ".mcap" in errors, (code, errors)
    trees = folder / "trees.csv"
    bare = ("--set", f"stand.trees={trees}", "--set", "duration_s=1", "--set", "stand.size_x_m=60",
            "--set", "stand.size_y_m=60")
    for text, word in ((None, "no such file"), ("x,y,dbh_m\n1,2,0.3\n3,4", "line 3: expected 3 cells"),
                       ("x,y,dbh_m\n1,nan,0.3\n", "line 2: y")):
        if text is not None:
            trees.write_text(text)
        code, _, errors = run("simulate", "demo", "-o", folder / "trees.mcap", *bare)
        assert code == 3 and word in errors, (code, errors)
    assert run("info", sample, "--turn")[0] == 2


def check_damage(folder):
    for name in ("rosbag/small_bz2.bag", "mcap/small_zstd.mcap"):
        whole = (SAMPLES / name).read_bytes()
        cut = folder / f"cut_{pathlib.Path(name).name}"
        cut.write_bytes(whole[: len(whole) // 2])
        said = info(cut)
        assert any(str(cut) in warning for warning in said["warnings"]), said["warnings"]


def check_copies(folder):
    """What a copy keeps beside the messages: when each arrived, and places that are told late. Readers sort by
    arrival, which tells how the clocks of the sensors run."""
    made, plain, copy = folder / "made.mcap", folder / "plain.mcap", folder / "again.mcap"
    small = [word for setting in ("duration_s=4", "lidar.model=VLP-16", "stand.size_x_m=40", "stand.size_y_m=40",
                                  "gnss.enabled=true") for word in ("--set", setting)]
    assert run("simulate", "demo", "-o", made, *small)[0] == 0
    assert run("convert", made, plain, "--compression", "none")[0] == 0
    messages = read_mcap(plain)
    start = messages[0].time
    spoilt = []
    for message in messages:
        if message.topic.startswith("/gnss"):
            message = message.stamped(message.stamp + 2_000_000_000)
        elif message.topic == "/tf_static":
            message.time = start + 3_000_000_000
        spoilt.append(message)
    spoilt.sort(key=lambda message: message.time)
    write_mcap(folder / "spoilt.mcap", spoilt)
    assert run("convert", folder / "spoilt.mcap", copy, "--compression", "none")[0] == 0
    copied = read_mcap(copy)
    for topic in ("/lidar", "/imu", "/gnss"):
        before, after = ([m.time for m in each if m.topic == topic] for each in (spoilt, copied))
        if topic == "/gnss":  # a fix waits for the message behind it, to be joined with its quality
            assert len(before) == len(after) and all(0 <= b - a < 50_000_000 for a, b in zip(before, after)), after
        else:
            assert before == after, (topic, before[:3], after[:3])
    assert [m.topic for m in copied if m.time > start + 2_500_000_000].count("/tf_static") == 1, "the late place is lost"


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        check_samples(folder)
        check_captures(folder)
        check_bad_captures(folder)
        check_refusals(folder)
        check_damage(folder)
        check_copies(folder)


main()
