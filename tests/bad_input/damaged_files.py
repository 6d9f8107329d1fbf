"""Damaged files through `understory map`: what is read of them, what is said, and the exit code."""

import random
import re
import shutil

from program import Cases, error_m, good_recording, map_recording, program, unfinished_run
from recordings import write_bag, write_capture, write_db3, write_mcap

cases = Cases()
good, messages, truth = good_recording()
scans = [m for m in messages if m.topic == "/lidar"]
ALL = len(scans)
plain = cases.folder / "plain.mcap"
places = write_mcap(plain, messages)
bag, db3, capture = (cases.folder / name for name in ("walk.bag", "walk.db3", "walk.pcap"))
write_bag(bag, messages)
write_db3(db3, messages)
write_capture(capture, scans[20:50])
clouds = cases.folder / "clouds"
assert program("convert", good, clouds).returncode == 0


def cut(source, folder, share=0.6):
    path = folder / source.name
    whole = source.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    return path


def flip(source, folder, places, mask=0x10):
    path = folder / source.name
    data = bytearray(source.read_bytes())
    for place in places:
        data[place] ^= mask
    path.write_bytes(data)
    return path


def expect_rest(outcome, said, share):
    """Exit 4, the message says where it is damaged, and that share of the scans was mapped well."""
    assert outcome.code == 4 and said in outcome.said, (outcome.code, outcome.said)
    error, pairs = error_m(outcome, truth)
    assert pairs > share * ALL and error < 0.05, (pairs, error)
    return f"exit 4, {pairs} of {ALL} scans kept, {100 * error:.1f} cm"


def expect_cut(outcome, path):
    """About the first 60 % were mapped, and mapped well; the message names file and byte."""
    assert outcome.code == 4, outcome.code
    assert re.search(re.escape(str(path)) + r": at byte \d+", outcome.said), outcome.said
    assert any(str(path) in reason for reason in outcome.run["reasons"]), outcome.run["reasons"]
    error, pairs = error_m(outcome, truth)
    assert abs(pairs - 0.6 * ALL) < 8 and error < 0.05, (pairs, error)
    return f"exit 4, {pairs} of {ALL} scans kept, {100 * error:.1f} cm"


def expect_mended(outcome, path, key):
    assert outcome.code == 0 and key in outcome.warnings, (outcome.code, outcome.said)
    assert str(path) in outcome.said, outcome.said
    error, pairs = error_m(outcome, truth)
    assert pairs >= ALL - 1 and error < 0.05, (pairs, error)
    return f"exit 0, {outcome.warnings[key]['message']}"


@cases.case("nothing wrong")
def whole(folder):
    outcome = map_recording(good, folder / "run")
    error, pairs = error_m(outcome, truth)
    assert outcome.code == 0 and outcome.said == "" and set(outcome.warnings) <= {"inventory"}, outcome.said
    assert outcome.run["counts"]["segments"] == 1
    assert pairs == ALL and error < 0.03, (pairs, error)
    return f"{100 * error:.1f} cm"


for name, source in (("chunked MCAP", good), ("MCAP without chunks", plain), ("bag", bag)):
    @cases.case(f"truncated {name}")
    def truncated(folder, source=source):
        path = cut(source, folder)
        return expect_cut(map_recording(path, folder / "run"), path)


@cases.case("truncated db3")
def truncated_db3(folder):
    path = cut(db3, folder)
    outcome = map_recording(path, folder / "run")
    assert outcome.code == 4 and f"{path}: the database is damaged after" in outcome.said
    error, pairs = error_m(outcome, truth)
    assert abs(pairs - 0.6 * ALL) < 8 and error < 0.05, (pairs, error)
    return f"exit 4, {pairs} of {ALL} scans kept, {100 * error:.1f} cm"


@cases.case("truncated capture")
def truncated_capture(folder):
    path = cut(capture, folder)
    outcome = map_recording(path, folder / "run")
    assert outcome.code == 4 and f"{path}: at byte" in outcome.said, outcome.said
    assert 16 <= len(outcome.poses) <= 19, len(outcome.poses)
    return f"exit 4, {len(outcome.poses)} of 30 scans kept"


@cases.case("recording that was not closed")
def unclosed(folder):
    path = folder / plain.name
    path.write_bytes(plain.read_bytes()[: places[-1]])  # ends between two messages
    return expect_mended(map_recording(path, folder / "run"), path, "recording.unfinished")


@cases.case("bag that was not closed")
def unclosed_bag(folder):
    return expect_mended(map_recording(bag, folder / "run"), bag, "recording.unfinished")


@cases.case("flipped bit in the index of an MCAP")
def flipped_index(folder):
    size = good.stat().st_size
    path = flip(good, folder, [size - 300])
    return expect_mended(map_recording(path, folder / "run"), path, "recording.mended")


@cases.case("flipped bits in chunks of an MCAP")
def flipped_chunks(folder):
    rest = random.Random(4)
    size = good.stat().st_size
    path = flip(good, folder, [int(size * rest.uniform(0.2, 0.8)) for _ in range(2)])
    outcome = map_recording(path, folder / "run")
    assert re.search(re.escape(str(path)) + r": at byte \d+", outcome.said), outcome.said
    return expect_rest(outcome, "checksum is wrong", 0.9)


@cases.case("destroyed record heads of an MCAP without chunks")
def destroyed_heads(folder):
    middle = [places[i] + 1 for i in (700, 701, 1500)]  # the lengths of three messages
    path = flip(plain, folder, [p + 5 for p in middle])
    return expect_rest(map_recording(path, folder / "run"), f"{path}: at byte {places[700]}", 0.9)


@cases.case("destroyed chunk head of a bag")
def destroyed_bag(folder):
    data = bag.read_bytes()
    place = data.index(b"op=\5", len(data) // 2)
    path = flip(bag, folder, [place, place + 1])
    return expect_rest(map_recording(path, folder / "run"), f"{path}: at byte", 0.85)


@cases.case("destroyed pages of a db3")
def destroyed_db3(folder):
    path = folder / db3.name
    data = bytearray(db3.read_bytes())
    page = 4096 * (len(data) // 8192)
    data[page : page + 8 * 4096] = bytes(8 * 4096)
    path.write_bytes(data)
    outcome = map_recording(path, folder / "run")
    # Bug: the last message before the damage was read twice.
    assert "second message" not in outcome.said, outcome.said
    return expect_rest(outcome, f"{path}: the database is damaged after", 0.9)


@cases.case("destroyed record heads of a capture")
def destroyed_capture(folder):
    record = 16 + 42 + 1206
    path = flip(capture, folder, [24 + record * 500 + 8, 24 + record * 501 + 9], 0xFF)
    outcome = map_recording(path, folder / "run")
    assert outcome.code == 4 and f"{path}: at byte {24 + record * 500}" in outcome.said, outcome.said
    assert len(outcome.poses) >= 27, len(outcome.poses)
    return f"exit 4, {len(outcome.poses)} of 30 scans kept"


@cases.case("damaged clouds in a folder")
def damaged_clouds(folder):
    path = folder / "clouds"
    shutil.copytree(clouds, path)
    names = sorted(p for p in path.iterdir() if p.suffix == ".pcd")
    whole = names[40].read_bytes()
    names[40].write_bytes(whole[: len(whole) // 2])
    names[60].write_bytes(b"")
    names[80].write_bytes(b"no cloud\n" * 100)
    outcome = map_recording(path, folder / "run")
    assert outcome.code == 4 and str(names[40]) in outcome.said, (outcome.code, outcome.said)
    assert outcome.warnings["recording.damaged"]["count"] == 3, outcome.said
    error, pairs = error_m(outcome, truth)
    assert pairs >= ALL - 3 and error < 0.05, (pairs, error)
    return f"exit 4, {pairs} of {ALL} scans kept, {100 * error:.1f} cm"


for name, content in (("empty file", b""), ("no recording", b"no recording\n" * 100),
                      ("only the head of an MCAP", good.read_bytes()[:40])):
    @cases.case(name)
    def refused(folder, name=name, content=content):
        path = folder / "x.mcap"
        path.write_bytes(content)
        outcome = map_recording(path, folder / "run")
        assert outcome.code == 3 and f"error: {path}" in outcome.said, outcome.said
        assert not (folder / "run").exists()
        stems = program("map", path, "-o", folder / "run", "--front-end", "sparse")
        assert stems.returncode == 3 and f"error: {path}" in stems.stderr, stems.stderr
        assert not (folder / "run").exists()
        if name != "only the head of an MCAP":  # that one can be opened
            unfinished = unfinished_run(folder / "run", b"kept")
            for front_end in ("dense", "sparse"):
                done = program("map", path, "-o", folder / "run", "--overwrite", "--front-end", front_end)
                assert done.returncode == 3 and unfinished.read_bytes() == b"kept", done.stderr
        return outcome.said.strip().splitlines()[-1].replace(str(folder), "")


@cases.case("recording without messages")
def no_messages(folder):
    path = folder / "x.mcap"
    write_mcap(path, [])
    outcome = map_recording(path, folder / "run")
    assert outcome.code == 3 and str(path) in outcome.said, outcome.said
    return outcome.said.strip().replace(str(folder), "")


@cases.case("info and convert of a truncated recording")
def others(folder):
    path = cut(good, folder)
    done = program("info", path)
    assert done.returncode == 0 and f"{path}: at byte" in done.stdout, done.stdout
    copy = folder / "copy.mcap"
    done = program("convert", path, copy)
    assert done.returncode == 4 and "so the output is partial" in done.stderr, done.stderr
    assert f"{path}: at byte" in done.stderr, done.stderr
    kept = program("info", "--json", copy)
    assert kept.returncode == 0 and '"warnings": []' in kept.stdout, kept.stdout
    stems = program("convert", path, folder / "stems.csv.gz")
    assert stems.returncode == 4 and "so the output is partial" in stems.stderr, stems.stderr
    return "exit 4, and the rest kept"


@cases.case("inventory, convert and register of damaged clouds")
def inventory(folder):
    done = program("map", good, "-o", folder / "run")
    assert done.returncode == 0, done.stderr
    path = cut(folder / "run" / "map.laz", folder, 0.8)
    done = program("inventory", path, "-o", folder / "plot")
    assert done.returncode == 4 and f"{path}: " in done.stderr, (done.returncode, done.stderr)
    assert len((folder / "plot" / "trees.csv").read_text().splitlines()) > 10
    done = program("convert", path, folder / "stems.csv.gz")
    assert done.returncode == 4 and f"{path}: " in done.stderr, (done.returncode, done.stderr)
    assert (folder / "stems.csv.gz").exists()
    done = program("register", folder / "run" / "map.laz", path)
    assert done.returncode == 4 and "a cloud is not whole" in done.stderr, (done.returncode, done.stderr)
    path.write_bytes(b"")
    done = program("inventory", path, "-o", folder / "none")
    assert done.returncode == 3 and f"{path}: the file is empty" in done.stderr, done.stderr
    before = (folder / "run" / "run.json").read_bytes()
    done = program("inventory", folder / "run", "-o", folder / "run")
    assert done.returncode == 3 and "which is read" in done.stderr, done.stderr
    assert (folder / "run" / "run.json").read_bytes() == before
    half = unfinished_run(folder / "half")
    done = program("inventory", folder / "run", "-o", folder / "half")
    assert done.returncode == 3 and "--overwrite" in done.stderr, done.stderr
    done = program("inventory", folder / "run", "-o", folder / "half", "--overwrite")
    assert done.returncode in (0, 4) and (folder / "half" / "trees.csv").exists(), done.stderr
    assert not half.parent.exists()
    return "exit 4, trees of the readable part"


cases.run()
