"""What `understory info` and `understory convert` answer to good and bad recordings: exit codes,
messages that name the file, and what is kept of damaged ones."""

import json
import os
import pathlib
import resource
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
        check_refusals(folder)
        check_damage(folder)
        check_copies(folder)


main()
