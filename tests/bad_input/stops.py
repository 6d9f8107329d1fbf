"""Ctrl-C and SIGTERM at many moments, in every command that takes long. It ends soon, with exit code 4,
leaves nothing half written, and former results stay. What `map` had positioned is gone on with."""

import shutil
import signal
import subprocess
import time

from program import PROGRAM, Cases, good_recording, program, snapshot, two_runs

cases = Cases()
FILES = ["trajectory.tum", "keyframes.tum", "graph.g2o", "states.csv.gz", "map.laz", "trees.csv"]
STEM_FILES = ["trajectory.tum", "odometry.tum", "stems.csv.gz", "trees.csv"]
PATIENCE_S = 30  # far more than a stop takes on a busy machine, far less than the work that is left
SIGNALS = (signal.SIGINT, signal.SIGTERM)
good, messages, truth = good_recording(seconds=8, more=("stand.size_x_m=40", "stand.size_y_m=40"))
RUN, STEMS, FIXES = two_runs(good)


def stop_at(stage, sent, *words):
    """Sends the signal as soon as the program reports that stage; what it came to and said."""
    process = subprocess.Popen([PROGRAM, *map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    said, reached = "", False
    for line in process.stderr:
        said += line
        if line.startswith(stage):
            process.send_signal(sent)
            reached = True
            break
    said += process.communicate(timeout=PATIENCE_S)[1]
    assert reached, f"no stage {stage!r}: {said}"
    return process.returncode, said


def stop_after(seconds, sent, *words):
    process = subprocess.Popen([PROGRAM, "--quiet", *map(str, words)], stdout=subprocess.DEVNULL,
                               stderr=subprocess.PIPE, text=True)
    time.sleep(seconds)
    process.send_signal(sent)
    said = process.communicate(timeout=PATIENCE_S)[1]
    return process.returncode, said


# A stage may be over before the signal arrives, above all on a busy machine: then the work ends as if nothing were sent.
def until_stopped(folder, attempt):
    """What `attempt(folder)` returns. While that is None, the work ended before the signal: again, in a new folder."""
    for k in range(8):
        fresh = folder / f"attempt{k}"
        fresh.mkdir(parents=True)
        told = attempt(fresh)
        if told:
            return told
    raise AssertionError("the program ended each time before the signal stopped it")


def was_stopped(code, said, stage):
    """False if the work was over before. A run without a stop ends with 0, or with 4 where it warns."""
    stopped = "stopped by the user" in said
    assert code == 4 if stopped else code in (0, 4), (stage, code, said)
    return stopped


# Once the recording was read, the signal waited for the end of all work. A run that was stopped goes on to its next stop.
def map_stopped(folder, stages, files, whole, *options):
    run = folder / "run"
    for k, stage in enumerate(stages):
        words = ("--resume", run) if run.exists() else (good, "-o", run, *options)
        code, said = stop_at(stage, SIGNALS[k % 2], "map", *words)
        if not was_stopped(code, said, stage):
            return None
        assert f"map --resume {run}" in said, (stage, code, said)
        assert [path.name for path in run.iterdir()] == [".understory"], stage
        assert not (run / ".understory" / "results").exists(), stage
    done = program("map", "--resume", run)
    assert done.returncode in (0, 4), done.stderr
    assert all((run / name).read_bytes() == (whole / name).read_bytes() for name in files)
    assert not (run / ".understory").exists()
    return ", ".join(stages)


@cases.case("map, once the scans are positioned")
def mapping(folder):
    stages = ("gathering the map", "ground", "stems", "stems", "tops", "segments", "writing map.laz")
    return until_stopped(folder, lambda fresh: map_stopped(fresh, stages, FILES, RUN))


@cases.case("map by stems, once the scans are positioned")
def mapping_stems(folder):
    return until_stopped(folder, lambda fresh: map_stopped(fresh, ("correction",), STEM_FILES, STEMS,
                                                           "--front-end", "sparse"))


def map_over_results(folder):
    run = folder / "run"
    shutil.copytree(RUN, run)
    before = snapshot(run)
    code, said = stop_at("stems", signal.SIGTERM, "map", good, "-o", run, "--overwrite")
    if not was_stopped(code, said, "stems"):
        return None
    assert "--resume" in said, said
    after = snapshot(run)
    assert {path: after[path] for path in before if path.is_file()} == {p: s for p, s in before.items() if p.is_file()}
    return "former results stay"


@cases.case("map in a folder with former results")
def former(folder):
    return until_stopped(folder, map_over_results)


def nothing_new(stage, sent, out, *words):
    """Stops the work at that stage; True if it left its folder as it was. None if it was over before."""
    before = snapshot(out.parent)
    code, said = stop_at(stage, sent, *words)
    if not was_stopped(code, said, stage):
        return None
    assert snapshot(out.parent) == before, (stage, said)
    return True


@cases.case("inventory")
def inventory(folder):
    cloud = RUN / "map.laz"
    for stage in ("ground", "stems", "tops", "crowns", "segments"):
        until_stopped(folder / stage, lambda fresh: nothing_new(stage, signal.SIGINT, fresh / "plot",
                                                                "inventory", cloud, "-o", fresh / "plot"))
    plot = folder / "plot"
    assert program("inventory", cloud, "-o", plot).returncode in (0, 4)
    until_stopped(folder / "over", lambda fresh: nothing_new("stems", signal.SIGTERM, plot, "inventory", cloud,
                                                             "-o", plot, "--overwrite"))
    until_stopped(folder / "converted", lambda fresh: nothing_new("stems", signal.SIGINT, fresh / "stems.csv.gz",
                                                                  "convert", cloud, fresh / "stems.csv.gz"))


COMMANDS = {
    "inventory of a run": ["inventory", RUN, "--set", "extent=basic", "-o", "OUT"],
    "georeference": ["georeference", RUN, "--method", "auto", "--gnss", FIXES, "-o", "OUT"],
    "georeference by trees": ["georeference", RUN, "--method", "trees", "--tree-map", RUN / "map.laz", "-o", "OUT"],
    "merge": ["merge", RUN, STEMS, "--align", "--reference", truth / "trees.csv", "-o", "OUT"],
    "correct": ["correct", STEMS / "stems.csv.gz", "-o", "OUT"],
    "register": ["register", RUN / "map.laz", RUN / "map.laz", "--guess", "0.2,0.1,0"],
    "evaluate map": ["evaluate", "map", RUN],
    "evaluate": ["evaluate", RUN, truth],
}


def stopped_at_any_time(folder, words):
    out = folder / "out"
    words = [out if word == "OUT" else word for word in words]
    began = time.monotonic()
    done = program(*words)
    took = time.monotonic() - began
    assert done.returncode in (0, 4), done.stderr
    before = snapshot(folder)
    stopped = 0
    for k in range(1, 4):
        fresh = folder / "fresh"
        again = [fresh if word == out else word for word in words]
        over = [*words, "--overwrite"] if out.exists() else words
        for case in (again, over):
            code, said = stop_after(took * k / 4, SIGNALS[k % 2], *case)
            ended = "warning: stopped by the user" in said  # `correct` has a partial result before
            stopped += ended or "stopped by the user" in said
            assert code == 4 if ended else code in (0, 4, -SIGNALS[k % 2]), (k, code, said)
            assert not ended or not fresh.exists(), (k, said)
            shutil.rmtree(fresh, ignore_errors=True)
            left = snapshot(folder)
            if ended:
                assert left == before, (k, set(left) ^ set(before))
            before = left
    assert stopped > 0 or took < 1.0, f"never stopped in {took:.1f} s"
    return f"{stopped} of 6 stops within {took:.1f} s"


for name, command in COMMANDS.items():
    @cases.case(name)
    def command_stopped(folder, command=command):
        return stopped_at_any_time(folder, command)


cases.run()
