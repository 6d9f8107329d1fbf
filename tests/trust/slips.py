"""Mistakes of a new user are named, with what to do about them. There are commands that do not exist,
clouds for recordings, sensors tens of metres apart, and rates in degrees. Also paths that do not
determine a figure, and progress that fits the terminal."""

import json
import math
import os
import pty
import random
import re
import shlex
import struct
import subprocess
import sys
import fcntl
import termios
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import PROGRAM, SMALL_STAND, Cases, good_recording, map_recording, program
from recordings import edit_imu, write_mcap

cases = Cases()


@cases.case("an unknown command is named, and the nearest one proposed")
def unknown(folder):
    for typed, meant in (("mpa", "map"), ("inventroy", "inventory"), ("geo", "georeference"),
                         ("Map", "map"), ("evalaute", "evaluate")):
        for words in ((typed,), (typed, "x.mcap", "-o", folder), ("--threads", "2", typed)):
            done = program(*words)
            assert done.returncode == 2, done
            assert f"'{typed}'" in done.stderr and f"did you mean '{meant}'" in done.stderr, done
    done = program("frobnicate")
    assert done.returncode == 2 and "'frobnicate'" in done.stderr and "inventory" in done.stderr, done
    assert program().returncode == 2 and program("--help").returncode == 0
    assert program("--version").returncode == 0


def plain(*words):
    """The program without options before its command: `help` is the first word."""
    return subprocess.run([PROGRAM, *words], capture_output=True, text=True)


@cases.case("help as a command, and a command that was left out")
def asked(folder):
    for words, page in ((("help",), ("--help",)), (("help", "map"), ("map", "--help")),
                        (("help", "calibrate", "imu"), ("calibrate", "imu", "--help")),
                        (("--quiet", "--threads", "2", "help", "map"), ("map", "--help"))):
        done = plain(*words)
        assert done.returncode == 0 and done.stdout and done.stdout == plain(*page).stdout, done
    assert "did you mean 'map'" in plain("help", "mpa").stderr
    for words, commands in (((), "demo, map, correct"), (("calibrate",), "imu, lidar-imu, lidars")):
        done = program(*words)
        assert done.returncode == 2 and f"expected a command: {commands}" in done.stderr, done
    assert "understory evaluate trees --help" in program("evaluate", "trees", "a").stderr
    done = program("map", "walk.mcap")
    assert done.returncode == 2 and "understory map walk.mcap -o RUN" in done.stderr, done
    done = program("inventory", "plot.laz")
    assert done.returncode == 2 and "understory inventory plot.laz -o DIR" in done.stderr, done


@cases.case("a setting of another command is named as this one calls it")
def settings(folder):
    for words, setting, meant in ((("map", "x.mcap", "-o", folder / "run"), "curves.species=pine", "inventory.curves.species"),
                                  (("inventory", "x.laz", "-o", folder / "run"), "inventory.stems.min_dbh_m=0.1", "stems.min_dbh_m")):
        done = program(*words, "--set", setting)
        assert done.returncode == 2 and f"did you mean {meant}?" in done.stderr, done
    for front_end, setting, other in (("dense", "stems.keep.distance_m=1", "sparse"), ("sparse", "keyframe.distance_m=1", "dense")):
        done = program("map", "x.mcap", "-o", folder / "run", "--front-end", front_end, "--set", setting)
        said = f"--set {setting.split('=')[0]}: is a setting of --front-end {other}"
        assert done.returncode == 2 and said in done.stderr, done
    done = program("map", "sim:demo?sed=4", "-o", folder / "run")
    assert done.returncode == 2 and "sim:demo?sed: unknown key (did you mean seed?)" in done.stderr, done


@cases.case("an unknown option is named, and the nearest one proposed")
def options(folder):
    for command, typed, meant in (("map", "--sett", "--set"), ("map", "--overwirte", "--overwrite"),
                                  ("convert", "--compresion=lz4", "--compression"), ("map", "--thread", "--threads")):
        done = program(command, "x.mcap", "-o", folder / "run", typed, "a=b")
        assert done.returncode == 2 and done.stderr.startswith("error: "), done
        assert f"'{typed.split('=')[0]}'" in done.stderr and f"did you mean '{meant}'" in done.stderr, done
    for typed in ("--registration", "--from-s"):  # nothing like it: --version and --crs were proposed once
        done = program("map", "x.mcap", "-o", folder / "run", typed, "3")
        assert done.returncode == 2 and f"no option '{typed}'" in done.stderr and "did you mean" not in done.stderr, done
    done = program("calibrate", "imu", "x.mcap", "-o", folder / "run", "--facotr", "2")
    assert done.returncode == 2 and "calibrate imu has no option" in done.stderr and "'--factor'" in done.stderr, done
    done = program("map", "x.mcap", "y.mcap", "z.mcap")
    assert done.returncode == 2 and "z.mcap" in done.stderr, done


@cases.case("files that are not there are said to be missing")
def missing(folder):
    gone = folder / "gone"
    for words in (("inventory", gone, "-o", gone), ("evaluate", gone, gone), ("correct", gone, "-o", folder / "run"),
                  ("info", gone), ("map", gone, "-o", folder / "run")):
        done = program(*words)
        assert done.returncode == 3 and f"{gone}: no such file or folder" in done.stderr, done
        assert not gone.exists() and not (folder / "run").exists()


@cases.case("a name that is nearly right is proposed")
def nearly(folder):
    walk, plot = folder / "my walk.mcap", folder / "plot.ply"
    for made in (walk, plot):
        made.write_bytes(b"nothing")
    out = folder / "run"
    for words, meant in ((("map", folder / "my walk", "-o", out), walk), (("info", folder / "my wlak.mcap"), walk),
                         (("inventory", folder / "plot", "-o", out), plot), (("register", folder / "plto.ply", plot), plot),
                         (("evaluate", folder / "my walk", plot), walk), (("convert", folder / "my walk.map", out), walk)):
        done = program(*words)
        assert done.returncode == 3 and f"no such file or folder; did you mean {shlex.quote(str(meant))}?" in done.stderr, done
    done = program("map", folder / "forest.mcap", "-o", out)
    assert done.returncode == 3 and "did you mean" not in done.stderr, done


@cases.case("the truth beside a recording is no recording")
def truth_for_recording(folder):
    walk, truth = folder / "walk.mcap", folder / "walk.truth"
    truth.mkdir()
    walk.write_bytes(b"nothing")
    for name in ("site.yaml", "trees.csv", "trajectory.tum"):
        (truth / name).write_text("x\n")
    for words in (("map", truth, "-o", folder / "run"), ("info", truth), ("convert", truth, folder / "out")):
        done = program(*words)
        assert done.returncode == 3 and f"and no scans: the recording is {walk}" in done.stderr, done


@cases.case("map of a cloud and inventory of a recording point to each other")
def other_way(folder):
    cloud = folder / "plot.ply"
    cloud.write_text("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
                     "property float z\nend_header\n1 2 3\n")
    for more in ((), ("--front-end", "sparse")):
        done = program("map", cloud, "-o", folder / "run", *more)
        assert done.returncode == 3 and f"understory inventory {cloud}" in done.stderr, done
    assert not (folder / "run").exists()
    walk = folder / "walk.mcap"
    walk.write_bytes(b"\x89MCAP0\r\n")
    clouds = folder / "clouds"
    clouds.mkdir()
    for words in (("merge", walk, clouds, "-o", folder / "both"), ("evaluate", walk, clouds), ("evaluate", "trees", clouds, walk),
                  ("evaluate", "map", walk), ("correct", walk, "-o", folder / "both")):
        done = program(*words)
        assert done.returncode == 3 and f"is a recording: map it first with `understory map {walk}" in done.stderr, done
    for recording in (walk, clouds, "sim:demo"):
        done = program("inventory", recording, "-o", folder / "plot")
        assert done.returncode == 3 and f"understory map {recording}" in done.stderr, done


@cases.case("evaluate of a list of trees names the command that compares lists")
def lists_for_paths(folder):
    plot, truth = folder / "my plot", folder / "truth"
    for made, path in ((plot, None), (truth, "100.0 0 0 0 0 0 0 1\n")):
        made.mkdir()
        (made / "trees.csv").write_text("id,x,y,dbh_m\n1,2,3,0.2\n")
        if path:
            (made / "trajectory.tum").write_text(path)
    for given in (plot, plot / "trees.csv"):
        for words in ((given, truth), (truth, given)):
            done = program("evaluate", *words)
            advice = f"understory evaluate trees {' '.join(shlex.quote(str(word)) for word in words)}"
            assert done.returncode == 3 and f"`{advice}` compares lists" in done.stderr, done
            assert program(*shlex.split(advice)[1:]).returncode == 0


GOOD, MESSAGES, TRUTH = good_recording(seconds=6, more=SMALL_STAND)


@cases.case("paths in two frames are told so")
def two_frames(folder):
    turned = folder / "turned.tum"
    with open(TRUTH / "trajectory.tum") as file:
        rows = [line.split() for line in file]
    turned.write_text("".join(f"{t} {-float(y) + 40} {x} {z} 0 0 0 1\n" for t, x, y, z, *_ in rows))
    done = program("evaluate", turned, TRUTH)
    assert done.returncode == 0 and "their frames may differ. --align se3" in done.stderr, done
    for words in ((turned, TRUTH, "--align", "se3"), (TRUTH, TRUTH)):
        done = program("evaluate", *words)
        assert done.returncode == 0 and "frames may differ" not in done.stderr, done


@cases.case("how sharp a map by stems is, by its folder or its stems alone")
def sharp_stems(folder):
    run = folder / "run"
    assert program("map", GOOD, "-o", run, "--front-end", "sparse").returncode in (0, 4)
    both = program("evaluate", "map", run / "stems.csv.gz", run / "trajectory.tum")
    assert both.returncode == 0 and "blurred area" in both.stdout, both
    for given in (run, run / "stems.csv.gz"):
        assert program("evaluate", "map", given).stdout == both.stdout
    alone = folder / "stems.csv.gz"
    alone.write_bytes((run / "stems.csv.gz").read_bytes())
    done = program("evaluate", "map", alone)
    assert done.returncode == 3 and f"understory evaluate map {alone} TRAJECTORY" in done.stderr, done


@cases.case("sensors that the extrinsics put tens of metres apart")
def arms(folder):
    done = program("info", GOOD)
    assert "from the body or the lidar" not in done.stdout, done.stdout
    extrinsics = folder / "arms.yaml"
    extrinsics.write_text("body_frame: base\n"
                          "body_from_lidar: {translation_m: [0, 0, 0], rpy_deg: [0, 0, 0]}\n"
                          "body_from_imu: {translation_m: [30, -12, 0.1], rpy_deg: [0, 0, 0]}\n")
    done = program("info", GOOD, "--extrinsics", extrinsics)
    assert done.returncode == 0 and "put the IMU 3" in done.stdout, done
    outcome = map_recording(GOOD, folder / "run", "--extrinsics", extrinsics)
    assert "recording.lever_arm" in outcome.warnings, outcome.warnings.keys()
    assert "[recording.lever_arm]" in outcome.said, outcome.said  # what the page of warnings lists


@cases.case("a run is no recording for info and convert either")
def run_for_recording(folder):
    assert program("map", GOOD, "-o", folder / "run").returncode == 0
    out = folder / "out"
    for words in (("info", folder / "run"), ("convert", folder / "run", out), ("convert", folder / "run", folder / "out.mcap"),
                  ("convert", folder / "run", folder / "out.csv.gz"), ("map", folder / "run", "-o", out)):
        done = program(*words)
        assert done.returncode == 3 and f"understory inventory {folder / 'run'} -o DIR" in done.stderr, done
    assert not list(folder.glob("out*"))
    done = program("map", "--resume", folder / "run")
    assert done.returncode == 3 and "is finished" in done.stderr and "report.html" in done.stderr, done
    done = program("map", "--resume", out)
    assert done.returncode == 3 and "no unfinished run" in done.stderr and "no such folder" in done.stderr, done


@cases.case("rates in degrees a second, beyond what any sensor tells in radians")
def degrees(folder):
    path = folder / "degrees.mcap"
    write_mcap(path, [edit_imu(m, lambda r, f: ([math.degrees(4 * v) for v in r], f))
                      if m.type.endswith("Imu") else m for m in MESSAGES])
    outcome = map_recording(path, folder / "run")
    told = outcome.warnings["imu.degrees"]
    assert "degrees per second" in told["message"] and told["count"] > 100, told
    assert "degrees per second" in outcome.said, outcome.said
    assert outcome.run["status"] != "complete", outcome.run["status"]
    reasons = outcome.run["reasons"]
    assert any("degrees per second" in reason for reason in reasons), reasons


@cases.case("wall_s is that of all the run, and that of an inventory of it too")
def wall(folder):
    began = time.monotonic()
    done = program("map", GOOD, "-o", folder / "run")
    took = time.monotonic() - began
    assert done.returncode == 0, done.stderr
    told = json.loads((folder / "run" / "run.json").read_text())
    finishing = sum(stage["total_wall_s"] for name, stage in told["stages"].items()
                    if name == "scan" or name.startswith("finish_"))
    assert finishing < told["wall_s"] <= took, (finishing, told["wall_s"], took)
    began = time.monotonic()
    done = program("inventory", folder / "run", "-o", folder / "plot")
    took = time.monotonic() - began
    told = json.loads((folder / "plot" / "run.json").read_text())
    stages = sum(stage["total_wall_s"] for stage in told["stages"].values())
    assert stages < told["wall_s"] <= took, (stages, told["wall_s"], took)
    return f"{finishing:.2f} s of stages in {told['wall_s']:.2f} s"


def path(points, noise_m=0.0, seed=1):
    draw = random.Random(seed)
    lines = []
    for k, point in enumerate(points):
        u = [v + draw.gauss(0, noise_m) for v in point]
        lines.append(f"{100 + 0.1 * k:.9f} {u[0]:.6f} {u[1]:.6f} {u[2]:.6f} 0 0 0 1")
    return "\n".join(lines) + "\n"


def evaluate(folder, truth, align, noise_m=0.01):
    (folder / "truth.tum").write_text(path(truth))
    (folder / "run.tum").write_text(path([(1 - y, 2 + x, z) for x, y, z in truth], noise_m))
    words = ("evaluate", folder / "run.tum", folder / "truth.tum", "--align", align)
    done, text = program(*words, "--json"), program(*words)
    assert "nan" not in done.stdout.lower() + text.stdout.lower(), text.stdout
    assert done.returncode == text.returncode
    return done, json.loads(done.stdout), text.stdout


@cases.case("figures that a straight path or one place does not determine")
def undetermined(folder):
    straight = [(0.1 * k, 0.0, 0.0) for k in range(300)]
    bent = [(0.1 * k, 3 * math.sin(0.02 * k), 0.0) for k in range(300)]
    still = [(5.0, 5.0, 0.0)] * 300
    done, told, text = evaluate(folder, straight, "se3")
    assert done.returncode == 0 and told["ape_rotation_rmse_deg"] is None, told
    assert any("not determined" in note for note in told["notes"]), told["notes"]
    assert "rotation not determined" in text and abs(told["scale_percent"]) < 1, text
    assert told["ape_rmse_m"] < 0.05 and told["alignment_found"]["determined"] is False, told
    done, told, text = evaluate(folder, straight, "yaw")
    assert done.returncode == 0 and abs(told["alignment_found"]["yaw_deg"] + 90) < 0.5, told
    assert abs(told["alignment_found"]["translation_m"][0] + 2) < 0.1 and "yaw -" in text, (told, text)
    done, told, text = evaluate(folder, bent, "se3")
    assert done.returncode == 0 and told["ape_rotation_rmse_deg"] is not None, (told, done.stderr)
    assert told["notes"] == [] and told["alignment_found"]["rotation_sd_deg"] < 1, told
    for align in ("none", "yaw", "se3"):
        done, told, text = evaluate(folder, still, align)
        assert told["scale_percent"] is None and "scale of the path   not determined" in text, text
        assert done.returncode == 0, (align, done)
        assert (told["alignment_found"] is None) == (align == "none"), told
    done, told, text = evaluate(folder, still, "se3", noise_m=0.0)
    assert done.returncode == 0 and told["scale_percent"] is None, told


def progress_of(words, columns=None):
    """What the program wrote to stderr: to a file, or to a terminal of some width."""
    if columns is None:
        return subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True).stderr
    ours, its = pty.openpty()
    fcntl.ioctl(its, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    child = subprocess.Popen([PROGRAM, *map(str, words)], stdout=subprocess.DEVNULL, stderr=its)
    os.close(its)
    told = b""
    try:
        while part := os.read(ours, 65536):
            told += part
    except OSError:  # the other side is closed
        pass
    child.wait()
    os.close(ours)
    return told.decode()


@cases.case("progress does not repeat itself and fits the terminal")
def progress(folder):
    words = ("map", GOOD, "-o", folder / "run", "--overwrite")
    lines = progress_of(words).splitlines()
    assert any(line.startswith("mapping") for line in lines), lines
    assert all(a != b for a, b in zip(lines, lines[1:])), lines
    told = progress_of(words, columns=30)
    shown = [line for line in re.split(r"\r\n|\r|\n", told.replace("\x1b[K", "")) if line]
    assert len(shown) > 3 and max(map(len, shown)) < 30, max(shown, key=len)
    assert any(len(line) == 29 for line in shown), shown


cases.run()
