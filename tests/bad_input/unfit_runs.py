"""Runs that a command cannot read, or not yet: of a newer version of the program, at work, killed, stopped. Every command
that takes a run says the same of them, and proposes a command that a shell takes as it stands."""

import fcntl
import json
import shlex
import shutil
import signal
import subprocess
import time

from program import PROGRAM, SMALL_STAND, Cases, good_recording, program, two_runs, unfinished_run

cases = Cases()
good, messages, truth = good_recording(seconds=8, more=SMALL_STAND)
RUN, STEMS, FIXES = two_runs(good)


def commands(run, stems, out):
    """Each command that reads a run; `stems` is one with stems."""
    return {
        "inventory": ("inventory", run, "-o", out),
        "correct": ("correct", stems, "-o", out),
        "georeference": ("georeference", run, "--method", "auto", "--gnss", FIXES, "-o", out),
        "merge": ("merge", run, STEMS, "--align", "-o", out),
        "merge, the other": ("merge", STEMS, run, "--align", "-o", out),
        "evaluate": ("evaluate", run, truth, "--align", "se3"),
        "evaluate, its path": ("evaluate", run / "trajectory.tum", truth, "--align", "se3"),
        "evaluate trees": ("evaluate", "trees", run, truth, "--align", "yaw"),
        "evaluate trees --path": ("evaluate", "trees", RUN, truth, "--align", "yaw", "--path", run),
        "evaluate map": ("evaluate", "map", run),
        "register": ("register", run / "map.laz", RUN / "map.laz"),
        "convert": ("convert", run, out.with_suffix(".geojson")),
        "info": ("info", run),
    }


def marked(run, to, **keys):
    shutil.copytree(run, to)
    told = json.loads((to / "run.json").read_text())
    assert told["format"] == 1, told.get("format")
    (to / "run.json").write_text(json.dumps(told | keys))
    return to


@cases.case("a newer format is refused by every command")
def newer_format(folder):
    run, stems = (marked(made, folder / made.name, version="9.8.7", format=2) for made in (RUN, STEMS))
    for name, words in commands(run, stems, folder / "out").items():
        done = program(*words)
        at = stems if name == "correct" else run
        assert done.returncode == 3 and f"{at}: was written by version 9.8.7" in done.stderr, (name, done)
        assert "format 2" in done.stderr, (name, done)
    assert not list(folder.glob("out*"))


@cases.case("a newer version of the same format is read with a warning")
def newer_version(folder):
    run, stems = (marked(made, folder / made.name, version="9.8.7") for made in (RUN, STEMS))
    for name, words in commands(run, stems, folder / "out").items():
        done = program(*words)
        at = stems if name == "correct" else run
        assert done.stderr.count(f"{at} was written by version 9.8.7") == 1, (name, done)
        assert "[run.newer_version]" in done.stderr, (name, done)
        shutil.rmtree(folder / "out", ignore_errors=True)
    done = program("inventory", RUN, "-o", folder / "plot")
    assert "newer" not in done.stderr, done


@cases.case("a newer version at work is refused")
def newer_work(folder):
    run = folder / "run"
    shutil.copytree(RUN, run)
    marker = unfinished_run(run).with_name("marker")
    marker.write_text(marker.read_text().replace("format: 1", "format: 2"))
    for name, words in commands(run, run, folder / "out").items():
        if "path" in name or name == "register":  # a finished file of it
            continue
        done = program(*words)
        assert done.returncode == 3 and "work folder has format 2" in done.stderr, (name, done)


def folder_commands(run, folder):
    return {name: words for name, words in commands(run, run, folder / "out").items() if run in words}


@cases.case("a killed map is finished by the command that is proposed")
def killed(folder):
    run = folder / "my run"
    process = subprocess.Popen([PROGRAM, "--quiet", "map", good, "-o", run])
    while not (run / ".understory" / "checkpoint.bin").exists():
        time.sleep(0.01)
    for name, words in folder_commands(run, folder).items():
        done = program(*words)
        if process.poll() is None:
            assert done.returncode == 3 and "is being written by another understory" in done.stderr, (name, done)
            assert f"(process {process.pid})" in done.stderr, (name, done)
    process.kill()
    process.wait()
    if (run / "run.json").exists():
        return "the map was done before it was killed"
    advice = f"understory map --resume '{run}'"
    for name, words in folder_commands(run, folder).items():
        done = program(*words)
        assert done.returncode == 3 and f"`{advice}` finishes it" in done.stderr, (name, done)
    done = program("map", good, "-o", run)
    assert done.returncode == 3 and f"go on with `{advice}`" in done.stderr, done
    assert program(*shlex.split(advice)[1:]).returncode == 0
    assert (run / "trajectory.tum").read_bytes() == (RUN / "trajectory.tum").read_bytes()
    return None


@cases.case("a locked folder without a checkpoint is at work, too")
def just_begun(folder):
    checkpoint = unfinished_run(folder / "run")
    checkpoint.unlink()
    with open(checkpoint.with_name("lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = program("inventory", folder / "run", "-o", folder / "out")
        assert done.returncode == 3 and "is being written by another" in done.stderr, done


@cases.case("a stopped map names its own folder")
def stopped(folder):
    for front_end in ("dense", "sparse"):
        run = folder / f"my {front_end} run"
        process = subprocess.Popen([PROGRAM, "--quiet", "map", "sim:demo?seed=5&duration_s=40", "-o", run, "--front-end",
                                    front_end], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while not (run / ".understory" / "checkpoint.2.bin").exists() and process.poll() is None:
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        out, said = process.communicate(timeout=120)
        advice = f"go on with `understory map --resume '{run}'`"
        assert process.returncode == 4 and advice in said, (front_end, process.returncode, said)
        reasons = json.loads((run / "run.json").read_text())["reasons"]
        assert any(advice in reason for reason in reasons), reasons


cases.run()
