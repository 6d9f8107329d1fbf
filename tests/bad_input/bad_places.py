"""Nowhere to write, a full disk, Ctrl-C and --realtime, through `understory map`."""

import os
import resource
import signal
import subprocess
import time

from program import PROGRAM, Cases, error_m, good_recording, map_recording, program
from recordings import write_mcap

cases = Cases()
good, messages, truth = good_recording()
FILES = ["trajectory.tum", "keyframes.tum", "graph.g2o", "states.csv.gz", "map.laz", "trees.csv"]
whole = cases.folder / "whole"
assert program("map", good, "-o", whole).returncode == 0


def same_as_whole(folder):
    different = [f for f in FILES if (whole / f).read_bytes() != (folder / f).read_bytes()]
    assert not different, f"{different} differ from those of an undisturbed run"


def map_until_stopped(run, **options):
    """`map` that cannot write all of its results, and says how to go on."""
    done = program("map", good, "-o", run, **options)
    assert done.returncode == 3 and done.stderr.startswith(f"error: {run}/"), done.stderr
    assert f"map --resume {run}" in done.stderr, done.stderr
    return done.stderr.strip()


def expect_resumed(run):
    assert program("map", "--resume", run).returncode == 0
    same_as_whole(run)


def refused(recording, place, *words):
    outcome = map_recording(recording, place)
    assert outcome.code == 3 and outcome.said.startswith(f"error: {place}"), outcome.said
    for word in words:
        assert word in outcome.said, outcome.said
    return outcome.said.strip()


@cases.case("folder below a file")
def below_a_file(folder):
    (folder / "notes").write_text("mine")
    said = refused(good, folder / "notes" / "run", f"{folder / 'notes'} is a file")
    refused(good, folder / "notes" / "deep" / "run", f"{folder / 'notes'} is a file")
    refused(good, folder / "notes")
    assert (folder / "notes").read_text() == "mine"
    return said.replace(str(folder), "")


@cases.case("folder that may not be written")
def read_only(folder):
    place = folder / "locked"
    place.mkdir()
    if os.geteuid() == 0:  # to whom permissions mean nothing
        mount = ["mount", "-t", "tmpfs", "-o", "ro,size=1m", "tmpfs", str(place)]
        if subprocess.run(mount, capture_output=True).returncode != 0:
            return "not tried: root, and nothing can be mounted"
        try:
            return refused(good, place / "run", "Read-only").replace(str(folder), "")
        finally:
            subprocess.run(["umount", str(place)], check=True)
    place.chmod(0o500)
    return refused(good, place / "run", "denied").replace(str(folder), "")


@cases.case("full disk")
def full_disk(folder):
    """The run stops with what it has, and goes on once there is room."""
    place = folder / "disk"
    place.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=5m", "tmpfs", str(place)],
                      capture_output=True).returncode != 0:
        return "not tried: nothing can be mounted (see the limit on files)"
    try:
        run = place / "run"
        said = map_until_stopped(run)
        subprocess.run(["mount", "-o", "remount,size=200m", str(place)], check=True)
        expect_resumed(run)
    finally:
        subprocess.run(["umount", str(place)], check=True)
    return said.replace(str(folder), "")


@cases.case("files that may not grow")
def limited(folder):
    """The same by a limit on the size of files, which needs no rights."""
    run = folder / "run"
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, resource.RLIM_INFINITY))
    said = map_until_stopped(run, preexec_fn=limit)
    assert not (run / "run.json").exists() and not (run / "trajectory.tum").exists()
    expect_resumed(run)
    return said.replace(str(folder), "")


@cases.case("folder in the place of a result")
def blocked_result(folder):
    run = folder / "run"
    (run / "map.laz" / "mine").mkdir(parents=True)
    return refused(good, run, "map.laz").replace(str(folder), "")


@cases.case("folder that holds other things")
def other_things(folder):
    run = folder / "run"
    run.mkdir()
    (run / "notes.txt").write_text("mine")
    (run / "work").mkdir()
    (run / "work" / "mine.bin").write_text("mine, too")
    outcome = map_recording(good, run)
    assert outcome.code == 0, outcome.said
    assert (run / "notes.txt").read_text() == "mine"
    assert (run / "work" / "mine.bin").read_text() == "mine, too"
    return "kept what is not a result"


def interrupted(run, checkpoints):
    """Maps until that many checkpoints have been written, then Ctrl-C."""
    process = subprocess.Popen(
        [PROGRAM, "map", str(good), "-o", str(run), "--quiet", "--threads", "1", "--set",
         "run.checkpoint_interval_s=1"],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    seen = set()
    for _ in range(20_000):
        if len(seen) >= checkpoints:
            break
        for checkpoint in run.rglob("checkpoint*.bin"):  # two, written in turn
            try:
                seen.add((checkpoint.name, checkpoint.stat().st_mtime_ns))
            except FileNotFoundError:
                pass
        time.sleep(0.0005)
    process.send_signal(signal.SIGINT)
    said = process.communicate()[1]
    return process.returncode, said


@cases.case("Ctrl-C")
def ctrl_c(folder):
    run = folder / "run"
    code, said = interrupted(run, 4)
    assert code == 4 and "stopped by the user" in said and "--resume" in said, (code, said)
    poses = (run / "trajectory.tum").read_text().splitlines()
    assert 10 < len(poses) < 120 and (run / "map.laz").exists(), len(poses)
    assert '"partial"' in (run / "run.json").read_text()
    assert map_recording(good, run).code == 3  # nothing is thrown away unasked
    expect_resumed(run)
    assert not (run / ".understory").exists()
    return f"exit 4 with {len(poses)} of 120 scans, the rest by --resume: the same bytes"


@cases.case("Ctrl-C at the very beginning")
def ctrl_c_at_once(folder):
    code, said = interrupted(folder / "run", 1)
    assert code == 4 and "stopped by the user" in said, (code, said)
    return said.strip()


@cases.case("realtime")
def realtime(folder):
    short = folder / "short.mcap"
    first = next(m for m in messages if m.topic == "/lidar").stamp
    write_mcap(short, [m for m in messages if m.time < first + 5e9])
    began = time.monotonic()
    outcome = map_recording(short, folder / "run", "--realtime")
    took = time.monotonic() - began
    assert outcome.code == 0 and 4.8 < took < 12, (outcome.code, took, outcome.said)
    quality = outcome.run["quality"]
    dropped = outcome.run["counts"]["scans_dropped"]
    assert outcome.run["scans"] + dropped in (49, 50), (outcome.run["scans"], dropped)
    assert 0 < quality["latency_ms_p50"] <= quality["latency_ms_p99"] <= quality["latency_ms_max"]
    error, _ = error_m(outcome, truth)
    assert error < 0.1, error
    return f"{dropped} dropped, latency {quality['latency_ms_mean']:.0f} ms, {100 * error:.1f} cm"


cases.run()
