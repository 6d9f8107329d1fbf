"""`--resume` goes on at its place in every kind of recording, without reading what lies before. What lies before
the checkpoint is spoilt to see that: had it been read, the run would say so or map something else."""

import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "bad_input"))
from program import PROGRAM, Cases, good_recording, program  # noqa: E402: found by the line above
from recordings import write_bag, write_capture, write_db3, write_indexed_mcap, write_mcap  # noqa: E402

cases = Cases()
good, messages, _ = good_recording(seconds=14)
scans = [message for message in messages if message.type.endswith("PointCloud2")]
of_ros = [message for message in messages if message.type.split("/")[-1] in ("PointCloud2", "Imu", "TFMessage")]
OPTIONS = ("--threads", "1", "--set", "run.checkpoint_interval_s=1")
PATH = ["trajectory.tum", "keyframes.tum", "graph.g2o", "states.csv.gz"]
DENSE = [*PATH, "map.laz", "trees.csv"]
NO_MAP = ("--set", "map.enabled=false")
STEMS = ["stems.csv.gz", "trajectory.tum", "odometry.tum", "steps.csv", "trees.csv"]
# Behind what is looked at to learn what the recording holds, and before where the runs are killed.
SPOILT_S = (3.5, 5.5)
LEAST_S = 7.0


def killed(recording, run, options):
    """Kills `map` once it has positioned `LEAST_S` of the recording and some more."""
    process = subprocess.Popen([PROGRAM, "--quiet", "map", str(recording), "-o", str(run), *OPTIONS, *options],
                               stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    growing, least = ("views.bin", 175_000) if "sparse" in options else ("journal.bin", 28_000)
    for _ in range(60_000):
        if process.poll() is not None or any(p.stat().st_size > least for p in run.rglob(growing)):
            break
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    said = process.communicate()[1]
    assert process.returncode == -signal.SIGKILL, f"the run had ended before it could be killed: {said}"


def spoil(path, parts):
    """Zeros in place of those bytes of scans that the file holds; how many of them."""
    content, count = bytearray(path.read_bytes()), 0
    for part in parts:
        at = content.find(part)
        if at >= 0:
            content[at:at + len(part)] = bytes(len(part))
            count += 1
    path.write_bytes(content)
    return count


def parts_of_scans(begin_s, end_s):
    first = scans[0].stamp
    for scan in scans:
        if begin_s <= (scan.stamp - first) * 1e-9 < end_s:
            yield bytes(scan.data[100_000:103_000])


def goes_on(folder, recording, spoil_it, files=PATH, options=NO_MAP):
    whole, run = folder / "whole", folder / "run"
    done = program("map", recording, "-o", whole, *OPTIONS, *options)
    assert done.returncode in (0, 4), done.stderr
    killed(recording, run, options)
    count = spoil_it(recording)
    assert count > 5, f"only {count} places were spoilt"
    done = subprocess.run([PROGRAM, "map", "--resume", str(run), "--threads", "1"], capture_output=True, text=True)
    assert done.returncode in (0, 4), done.stderr
    begun = float(re.search(r"goes on at ([\d.]+) s", done.stderr)[1]) - scans[0].stamp * 1e-9
    assert begun >= SPOILT_S[1] + 0.5 or begun < 0, f"killed too early, at {begun:.1f} s"
    keys = [{w["key"]: w["count"] for w in json.loads((at / "run.json").read_text())["warnings"]} for at in (whole, run)]
    assert keys[0] == keys[1], keys
    different = [f for f in files if (whole / f).read_bytes() != (run / f).read_bytes()]
    assert not different, f"{different} differ"
    return f"went on with {count} places before it spoilt"


def in_one_file(path):
    return spoil(path, parts_of_scans(*SPOILT_S))


@cases.case("MCAP")
def mcap(folder):
    write_indexed_mcap(folder / "r.mcap", messages)
    return goes_on(folder, folder / "r.mcap", in_one_file, DENSE, ())


@cases.case("MCAP by stems")
def mcap_stems(folder):
    write_indexed_mcap(folder / "r.mcap", messages)
    return goes_on(folder, folder / "r.mcap", in_one_file, STEMS, ("--front-end", "sparse"))


@cases.case("MCAP without index")
def unindexed(folder):
    write_mcap(folder / "r.mcap", messages)
    return goes_on(folder, folder / "r.mcap", in_one_file)


@cases.case("ROS 1 bag")
def bag(folder):
    write_bag(folder / "r.bag", of_ros, indexed=True)
    return goes_on(folder, folder / "r.bag", in_one_file)


@cases.case("ROS 2 bag")
def db3(folder):
    write_db3(folder / "r.db3", messages)
    return goes_on(folder, folder / "r.db3", in_one_file)


@cases.case("capture")
def capture(folder):
    write_capture(folder / "r.pcap", scans)

    def spoil_packets(path):
        content = bytearray(path.read_bytes())
        record = (len(content) - 24) // len([*range(24, len(content), 1264)])
        begin, end = (int(len(content) * s / 14.0) for s in SPOILT_S)
        places = range(24 + (begin // record) * record, end, 40 * record)
        for at in places:
            content[at + 200:at + 260] = bytes(60)
        path.write_bytes(content)
        return len(places)

    return goes_on(folder, folder / "r.pcap", spoil_packets)


@cases.case("folder of clouds")
def clouds(folder):
    assert program("convert", good, folder / "clouds", "--format", "pcd").returncode == 0

    def spoil_files(path):
        files = sorted(path.glob("*.pcd"))[int(10 * SPOILT_S[0]):int(10 * SPOILT_S[1])]
        for file in files:
            file.write_bytes(bytes(file.stat().st_size))
        return len(files)

    return goes_on(folder, folder / "clouds", spoil_files)


cases.run()
