"""Commands that are broken off in the middle, killed, stopped or out of room. What was there before
stays, nothing half made is seen, and the same command works afterwards. A run at work is left alone by
all others."""

import gzip
import os
import resource
import signal
import subprocess
import time

from program import PROGRAM, Cases, program

SMALL = [word for setting in ("lidar.model=VLP-16", "stand.size_x_m=30", "stand.size_y_m=30") for word in ("--set", setting)]
SITE = "sim:demo?lidar.model=VLP-16&stand.size_x_m=30&stand.size_y_m=30&duration_s="
cases = Cases()
stems = cases.folder / "stems.csv.gz"
with gzip.open(stems, "wt") as file:
    file.write("frame,timestamp,x,y,z\n" + "".join(f"{t},{t},{5 + i - t % 40},{i * i % 7},0\n" for t in range(80) for i in range(9)))


def start(*arguments):
    return subprocess.Popen([PROGRAM, "--quiet", *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                            text=True)


def wait_for(something, process):
    for _ in range(20_000):
        if something():
            return
        assert process.poll() is None, f"ended before it could be broken off: {process.stderr.read()}"
        time.sleep(0.002)
    raise AssertionError("nothing came")


def seen(folder):
    return sorted(path.name for path in folder.iterdir() if not path.name.startswith(".part.understory."))


# What each command makes, in a folder of its own: long enough to be broken off, and the same once more, short.
COMMANDS = {
    "simulate": (("simulate", "demo", "-o", "OUT/walk.mcap", *SMALL, "--duration-s"), ["walk.mcap", "walk.truth"]),
    "simulate a capture": (("simulate", "demo", "-o", "OUT/walk.pcap", *SMALL, "--set", "lidar.range_step_m=0.002", "--duration-s"),
                           ["walk.extrinsics.yaml", "walk.nmea", "walk.pcap", "walk.truth"]),
    "convert": (("convert", SITE, "OUT/walk.mcap"), ["walk.mcap"]),
    "convert to clouds": (("convert", SITE, "OUT/clouds"), ["clouds"]),
    "convert to stems": (("convert", SITE, "OUT/walk.csv.gz"), ["walk.csv.gz"]),
}


def words(command, folder, seconds):
    place = [str(word).replace("OUT", str(folder)) for word in COMMANDS[command][0]]
    return [word + str(seconds) if word == SITE else word for word in place] + ([seconds] if "simulate" in command else [])


for command in COMMANDS:
    @cases.case(f"{command}, killed")
    def killed(folder, command=command):
        process = start(*words(command, folder, 60))
        wait_for(lambda: list(folder.glob(".part.understory.*")), process)
        time.sleep(0.3)
        second = program(*words(command, folder, 2))
        assert second.returncode == 3 and "being written" in second.stderr, second.stderr
        process.kill()
        process.wait()
        assert seen(folder) == [], seen(folder)
        done = program(*words(command, folder, 2))
        assert done.returncode == 0, done.stderr
        assert sorted(os.listdir(folder)) == COMMANDS[command][1], os.listdir(folder)

    @cases.case(f"{command}, out of room")
    def out_of_room(folder, command=command):
        limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100, resource.RLIM_INFINITY))
        done = program(*words(command, folder, 2), preexec_fn=limit)
        assert done.returncode == 3 and "cannot be written" in done.stderr, (done.returncode, done.stderr)
        assert os.listdir(folder) == [], os.listdir(folder)
        return done.stderr.strip().replace(str(folder), "")


@cases.case("convert over a good file, stopped and out of room")
def good_stays(folder):
    out = folder / "walk.mcap"
    assert program("convert", SITE + "1", out).returncode == 0
    before = out.read_bytes()
    process = start("convert", SITE + "60", out, "--overwrite")
    wait_for(lambda: list(folder.glob(".part*")), process)
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    said = process.communicate()[1]
    assert process.returncode == 4 and "left as it was" in said, (process.returncode, said)
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100, resource.RLIM_INFINITY))
    assert program("convert", SITE + "2", out, "--overwrite", preexec_fn=limit).returncode == 3
    assert out.read_bytes() == before and os.listdir(folder) == ["walk.mcap"], os.listdir(folder)


@cases.case("a folder of results, out of room and killed")
def results(folder):
    run = folder / "run"
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100, resource.RLIM_INFINITY))
    done = program("correct", stems, "-o", run / "below", preexec_fn=limit)
    assert done.returncode == 3 and "cannot be written" in done.stderr and not run.exists(), done.stderr
    assert program("correct", stems, "-o", run).returncode in (0, 4)
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    assert program("correct", stems, "-o", run, "--overwrite", preexec_fn=limit).returncode == 3
    process = start("correct", stems, "-o", run, "--overwrite")
    wait_for(lambda: (run / ".understory" / "marker").exists(), process)
    process.send_signal(signal.SIGSTOP)  # so that it is not done before it is killed
    second = program("correct", stems, "-o", run, "--overwrite")
    assert second.returncode == 3 and "being written" in second.stderr, second
    process.kill()
    process.wait()
    assert {path.name: path.read_bytes() for path in run.iterdir() if path.is_file()} == before
    assert program("correct", stems, "-o", run, "--overwrite").returncode in (0, 4)
    assert not (run / ".understory").exists() and sorted(os.listdir(run)) == sorted(before), os.listdir(run)


@cases.case("a run at work")
def at_work(folder):
    run = folder / "run"
    process = start("map", SITE + "60", "-o", run, "--set", "map.enabled=false")
    wait_for(lambda: (run / ".understory" / "checkpoint.bin").exists(), process)
    for command in (("map", SITE + "1", "-o", run), ("map", SITE + "1", "-o", run, "--overwrite"), ("map", "--resume", run),
                    ("map", SITE + "1", "-o", run, "--overwrite", "--front-end", "sparse"),
                    ("correct", stems, "-o", run, "--overwrite"), ("demo", "-o", run, "--overwrite")):
        done = program(*command)
        assert done.returncode == 3 and f"being written by another understory (process {process.pid})" in done.stderr, done
    process.kill()  # and the lock falls
    process.wait()
    done = program("map", SITE + "1", "-o", run)
    assert done.returncode == 3 and "--resume" in done.stderr, done.stderr
    done = program("map", SITE + "1", "-o", run, "--overwrite")
    assert done.returncode in (0, 4) and not (run / ".understory").exists(), done.stderr


cases.run()
