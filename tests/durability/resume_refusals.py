"""What `understory map --resume` refuses and what it finds: other inputs, options, another folder to call it from,
broken checkpoints, a recording that goes away."""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "bad_input"))
from program import PROGRAM, Cases, good_recording, program  # noqa: E402: found by the line above

cases = Cases()
good, _, _ = good_recording()
# Of maps: resume_agreement.py.
OPTIONS = ("--threads", 1, "--set", "run.checkpoint_interval_s=1", "--set", "map.enabled=false")
FILES = ["trajectory.tum", "keyframes.tum", "graph.g2o", "states.csv.gz"]
whole = cases.folder / "whole"
assert program("map", good, "-o", whole, *OPTIONS).returncode == 0


def work_of(run):
    return next(run.rglob("checkpoint.bin")).parent


def started(recording, run, *options, **more):
    """`map` at work, with some checkpoints behind it."""
    process = subprocess.Popen([PROGRAM, "--quiet", "map", str(recording), "-o", str(run), *map(str, OPTIONS), *options],
                               stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, **more)
    at = pathlib.Path(more.get("cwd", "."), run)
    for _ in range(40_000):
        if any(path.stat().st_size > 20_000 for path in at.rglob("journal.bin")):
            return process
        time.sleep(0.005)
    raise AssertionError("the run did not get far enough")


def killed(recording, run, *options, **more):
    process = started(recording, run, *options, **more)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL, "the run had ended before it could be killed"


def refused(code, *arguments, words=()):
    done = program("map", *arguments)
    assert done.returncode == code and "error: " in done.stderr, (done.returncode, done.stderr)
    for word in words:
        assert word in done.stderr, done.stderr
    return done.stderr.strip()


def same_as_whole(run):
    different = [f for f in FILES if (whole / f).read_bytes() != (run / f).read_bytes()]
    assert not different, f"{different} differ from those of an undisturbed run"


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file() and path.name != "lock"}


@cases.case("options beside --resume")
def options(folder):
    killed(good, folder / "run")
    kept = contents(folder / "run")
    for given in (["--set", "map.thin_m=0.5"], ["--profile", "harvester"], ["--front-end", "sparse"],
                  ["--config", str(good)], [str(good)], ["-o", str(folder / "other")], ["--realtime"], ["--overwrite"],
                  ["--lidar-topic", "/x"], ["--extrinsics", "e.yaml"], ["--rate-hz", "5"]):
        name = "RECORDING" if given == [str(good)] else {"-o": "--output"}.get(given[0], given[0])
        refused(2, "--resume", folder / "run", *given, words=["--resume", name])
    assert contents(folder / "run") == kept
    assert program("map", "--resume", folder / "run").returncode == 0
    same_as_whole(folder / "run")
    return refused(3, "--resume", folder / "run", words=["is finished"])


@cases.case("another recording")
def another_recording(folder):
    recording = folder / "r.mcap"
    shutil.copy(good, recording)
    killed(recording, folder / "run")
    kept = contents(folder / "run")
    content = recording.read_bytes()
    for spoilt in (content[:-1], content[:100] + b"x" + content[101:], content[:-9] + b"x" + content[-8:]):
        recording.write_bytes(spoilt)
        said = refused(3, "--resume", folder / "run", words=[str(recording), "the recording that the run was begun with"])
    assert contents(folder / "run") == kept
    recording.write_bytes(content)
    assert program("map", "--resume", folder / "run").returncode == 0
    same_as_whole(folder / "run")
    return said.replace(str(folder), "")


@cases.case("other extrinsics and machine boxes")
def other_files(folder):
    extrinsics, boxes = folder / "e.yaml", folder / "b.yaml"
    extrinsics.write_text("body_from_imu: {translation_m: [0, 0, 0]}\n")
    boxes.write_text("boxes:\n  - {name: mast, frame: body, center_m: [-0.75, 0, 0], size_m: [0.5, 2, 2]}\n")
    for more in (["--extrinsics", str(extrinsics)], ["--set", f"preprocess.machine_boxes_file={boxes}"]):
        done = program("map", good, "-o", folder / "try", "--overwrite", *OPTIONS, *more)
        assert done.returncode in (0, 4), done.stderr
    killed(good, folder / "run", "--extrinsics", str(extrinsics), "--set", f"preprocess.machine_boxes_file={boxes}")
    for file, words in ((extrinsics, "the extrinsics"), (boxes, "the file of the configuration")):
        content = file.read_text()
        file.write_text(content + "# changed\n")
        refused(3, "--resume", folder / "run", words=[str(file), words])
        file.write_text(content)
    assert program("map", "--resume", folder / "run").returncode in (0, 4)
    return "refused by name, taken when put back"


@cases.case("from another folder")
def elsewhere(folder):
    shutil.copy(good, folder / "r.mcap")
    killed("r.mcap", "run", cwd=folder)
    done = program("map", "--resume", folder / "run", cwd="/")
    assert done.returncode == 0, done.stderr
    same_as_whole(folder / "run")
    return "found the recording that was named relative to the first folder"


@cases.case("a site's file from another folder")
def site_elsewhere(folder):
    site = program("simulate", "demo", "--print-site", "--set", "lidar.model=VLP-16", "--set", "carrier.still_s=1")
    assert site.returncode == 0, site.stderr
    (folder / "site.yaml").write_text(site.stdout)
    recording = "sim:site.yaml?seed=5&duration_s=12&cache=scans"
    done = program("map", recording, "-o", "undisturbed", *OPTIONS, cwd=folder)
    assert done.returncode == 0, done.stderr
    killed(recording, "run", cwd=folder)
    (folder / "elsewhere").mkdir()
    shutil.copytree(folder / "run", folder / "copy")
    done = program("map", "--resume", folder / "run", cwd=folder / "elsewhere")
    assert done.returncode == 0, done.stderr
    different = [f for f in FILES if (folder / "undisturbed" / f).read_bytes() != (folder / "run" / f).read_bytes()]
    assert not different and not list((folder / "elsewhere").iterdir()), different
    (folder / "site.yaml").write_text(site.stdout + "# changed\n")
    refused(3, "--resume", folder / "copy", words=["is not the recording that the run was begun with"])
    return "found the site and the scans that were kept; another site is refused"


@cases.case("a run at work")
def at_work(folder):
    process = started(good, folder / "run")
    process.send_signal(signal.SIGSTOP)
    try:
        # As if it were just being written: nothing of it is read before it is known whose it is.
        for checkpoint in work_of(folder / "run").glob("checkpoint*.bin"):
            checkpoint.write_bytes(b"half")
        return refused(3, "--resume", folder / "run", words=["is being written by another understory"])
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()


@cases.case("broken checkpoints")
def broken(folder):
    killed(good, folder / "run", "--set", "map.enabled=true")
    work = work_of(folder / "run")
    checkpoints = sorted(work.glob("checkpoint*.bin"), key=lambda path: path.read_bytes()[24:32][::-1])
    assert len(checkpoints) == 2
    newest = bytearray(checkpoints[1].read_bytes())
    newest[len(newest) // 2] ^= 1
    checkpoints[1].write_bytes(newest)
    before = contents(folder / "run")
    shutil.copytree(folder / "run", folder / "copy")
    done = program("map", "--resume", folder / "run")
    assert done.returncode == 0 and "newest checkpoint is not whole" in done.stderr, done.stderr
    same_as_whole(folder / "run")
    # The data of the older one are broken as well: nothing can be gone on from, and nothing is changed.
    work = work_of(folder / "copy")
    clouds = bytearray((work / "clouds.bin").read_bytes())
    clouds[100] ^= 1
    (work / "clouds.bin").write_bytes(clouds)
    said = refused(3, "--resume", folder / "copy", words=["clouds.bin", "nothing was changed"])
    after = contents(folder / "copy")
    assert {name for name in before if before[name] != after[name]} == {"clouds.bin"}
    return said.replace(str(folder), "")


@cases.case("recording that goes away")
def goes_away(folder):
    recording = folder / "r.mcap"
    shutil.copy(good, recording)
    process = started(recording, folder / "run")
    recording.unlink()  # what is open stays readable, as the cache of a disk that was pulled out
    said = process.communicate()[1]
    assert process.returncode == 0, said
    same_as_whole(folder / "run")
    run = json.loads((folder / "run" / "run.json").read_text())
    assert run["inputs"][0]["sha256"] is None, run["inputs"]
    assert "recording.no_hash" in [w["key"] for w in run["warnings"]], run["warnings"]
    return said.strip().replace(str(folder), "")


cases.run()
