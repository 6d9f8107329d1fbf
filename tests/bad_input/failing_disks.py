"""A disk that cannot be read any further (EIO), met by every reader: it is no end of the file. What
was read so far is kept and can be gone on with; where nothing was, the exit code is 3. A library
that the program is made to load plays the disk."""

import gzip
import math
import os
import pathlib
import re
import shutil

from program import Cases, good_recording, map_recording, program
from recordings import write_bag, write_capture, write_db3, write_mcap

LIBRARY = pathlib.Path(os.environ["UNDERSTORY_BUILD"]) / "tests" / "failing_disk.so"
if not LIBRARY.exists():
    print("no library that plays the disk (a build with sanitizers)")
    raise SystemExit(77)

cases = Cases()
good, messages, truth = good_recording(seconds=6)
scans = [m for m in messages if m.topic == "/lidar"]
bag, db3, capture = (cases.folder / name for name in ("walk.bag", "walk.db3", "walk.pcap"))
write_bag(bag, messages)
write_db3(db3, messages)
write_capture(capture, scans[10:40])
whole = map_recording(good, cases.folder / "whole")
assert whole.code == 0, whole.said


def failing(path, share=0.6):
    """The environment in which that file cannot be read from that share of it on."""
    byte = int(share * path.stat().st_size)
    return {**os.environ, "LD_PRELOAD": str(LIBRARY), "UNDERSTORY_FAILING_FILE": str(path.resolve()),
            "UNDERSTORY_FAILING_BYTE": str(byte)}


def refused(path, *words, share=0.6, place=r"(at byte|line) \d+"):
    """Exit 3, with file, place and the system's reason."""
    done = program(*words, env=failing(path, share))
    said = re.escape(str(path)) + ": " + place + r": cannot be read: Input/output error"
    assert done.returncode == 3 and re.search(said, done.stderr), (done.returncode, done.stderr)
    return done.stderr.strip().splitlines()[-1].replace(str(cases.folder), "")


for name, source, share in (("an MCAP", good, 0.6), ("a bag", bag, 0.6), ("a db3", db3, 0.6),
                            ("a capture", capture, 0.6)):
    @cases.case(f"in the middle of {name}")
    def middle(folder, source=source, share=share):
        outcome = map_recording(source, folder / "run", env=failing(source, share))
        reason = outcome.run["reasons"][0] if outcome.run else ""
        assert outcome.code == 4 and outcome.run["status"] == "partial", outcome.said
        assert str(source) in reason and "Input/output error" in reason and "--resume" in reason, reason
        undisturbed = whole if source == good else map_recording(source, folder / "other")
        kept, all_of_it = len(outcome.poses), len(undisturbed.poses)
        assert 0.3 * all_of_it < kept < 0.7 * all_of_it, (kept, all_of_it)
        if source == good:
            done = program("map", "--resume", folder / "run")
            assert done.returncode == 0, done.stderr
            assert outcome.poses == undisturbed.poses, "gone on with, the path is another"
        return f"exit 4, {reason}".replace(str(cases.folder), "")


@cases.case("in the middle of an MCAP, by stems")
def stems(folder):
    done = program("map", good, "-o", folder / "run", "--front-end", "sparse", env=failing(good))
    assert done.returncode == 4 and "Input/output error" in done.stderr, done.stderr
    done = program("map", "--resume", folder / "run")
    assert "Input/output error" not in done.stderr and done.returncode in (0, 4), done.stderr
    return "exit 4, gone on with"


for name, source in (("an MCAP", good), ("a bag", bag), ("a db3", db3), ("a capture", capture)):
    @cases.case(f"at the beginning of {name}")
    def beginning(folder, source=source):
        said = refused(source, "map", source, "-o", folder / "run", share=0.0)
        assert not (folder / "run").exists()
        refused(source, "info", source, share=0.0)
        return said


@cases.case("info and convert")
def others(folder):
    refused(good, "info", good)
    said = refused(good, "convert", good, folder / "copy.mcap")
    left = [p.name for p in folder.iterdir()]
    assert not left, left
    return said


@cases.case("clouds and tables of a folder")
def clouds(folder):
    said = []
    for kind in ("bin", "ply", "pcd", "laz"):
        path = folder / kind
        done = program("convert", good, path, "--format", kind)
        assert done.returncode == 0, done.stderr
        names = sorted(p for p in path.iterdir() if p.suffix == f".{kind}")
        place = r"(at byte|behind point) \d+" if kind == "laz" else r"at byte \d+"
        refused(names[0], "inventory", names[0], "-o", folder / "plot", place=place)
        done = program("info", path, env=failing(names[30]))
        assert done.returncode == 3 and f"{names[30]}: " in done.stderr, done.stderr
        assert "cannot be read: Input/output error" in done.stderr, done.stderr
        said.append(kind)
    for table, place in (("times.txt", r"at byte \d+"), ("imu.csv", r"line \d+")):
        refused(folder / "bin" / table, "info", folder / "bin", share=0.3, place=place)
        said.append(table)
    outcome = map_recording(folder / "bin", folder / "run", "--extrinsics",
                            folder / "bin" / "extrinsics.yaml", env=failing(names_of(folder / "bin")[30]))
    assert outcome.code == 4 and outcome.run["status"] == "partial", outcome.said
    assert len(outcome.poses) < 31, len(outcome.poses)
    return ", ".join(said)


def names_of(folder):
    return sorted(p for p in folder.iterdir() if p.suffix == ".bin")


@cases.case("settings and tables")
def settings(folder):
    stems = folder / "stems.csv.gz"
    rows = "".join(f"{i // 4},{i % 4},{i % 7},0.{i}\n" for i in range(20000))
    stems.write_bytes(gzip.compress(("frame,x,y,z\n" + rows).encode()))
    refused(stems, "correct", stems, "-o", folder / "run", place=r"line \d+")
    tum = folder / "a.tum"
    tum.write_text("".join(f"{i} {i} 0 0 0 0 0 1\n" for i in range(20000)))
    refused(tum, "evaluate", tum, truth / "trajectory.tum")
    trees = folder / "trees.csv"
    trees.write_text("x,y\n" + "".join(f"{i},{i}\n" for i in range(20000)))
    refused(trees, "evaluate", "trees", trees, truth / "trees.csv")
    yaml = folder / "a.yaml"
    yaml.write_text("# only a note\n" * 10000)
    for words in (("--config", yaml), ("--extrinsics", yaml),
                  ("--set", f"preprocess.machine_boxes_file={yaml}")):
        refused(yaml, "map", good, "-o", folder / "run", *words)
    refused(yaml, "map", capture, "-o", folder / "other", "--metadata", yaml)
    return "exit 3 each"


@cases.case("a terrain model")
def terrain(folder):
    """GDAL takes it for the end of the file, so the program reads the file itself before."""
    assert program("map", good, "-o", folder / "mapped").returncode == 0
    shutil.copy(truth / "dtm.tif", folder / "dem.tif")
    heights = [[round(0.05 * column + math.sin(0.1 * row), 2) for column in range(300)] for row in range(300)]
    (folder / "dem.asc").write_text("ncols 300\nnrows 300\nxllcorner -150\nyllcorner -150\ncellsize 1\n" +
                                    "".join(" ".join(map(str, row)) + "\n" for row in heights))
    (folder / "dem.xyz").write_text("".join(f"{column - 149.5} {149.5 - row} {heights[row][column]}\n"
                                            for row in range(300) for column in range(300)))
    said = []
    for name in ("dem.tif", "dem.asc", "dem.xyz"):
        words = ("georeference", folder / "mapped", "--method", "terrain", "--dem", folder / name, "--start", 0, 0, 0,
                 "-o", folder / "run")
        done = program(*words)
        assert "cannot be read" not in done.stderr, done.stderr
        shutil.rmtree(folder / "run", ignore_errors=True)
        for share in (0.0, 0.5):
            done = program(*words, env=failing(folder / name, share))
            assert done.returncode == 3 and f"{folder / name}: " in done.stderr, (name, share, done.stderr)
            assert "cannot be read: Input/output error" in done.stderr, (name, share, done.stderr)
            assert not (folder / "run").exists()
            said.append(done.stderr.strip().replace(str(folder), ""))
    return said[1]


cases.run()
