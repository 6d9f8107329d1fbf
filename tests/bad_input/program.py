"""Runs the program on spoilt input and keeps what it said. What is promised is in
docs/reference/troubleshooting.md: 0 mended or harmless, 3 nothing usable, 4 not to be trusted or partial."""

import concurrent.futures
import fcntl
import functools
import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import time

from recordings import Message, read_mcap, write_mcap

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
SITE = ("lidar.model=VLP-16", "carrier.still_s=1",
        "carrier.turn_interval_s=4", "gnss.enabled=false")
# Fixes that are good everywhere, and a stand of few trees, for tests of something else than trees.
GOOD_SKY = ("gnss.canopy_sd_m=0.02", "gnss.open_sd_m=0.02", "gnss.white_sd_m=0.02", "gnss.jump_interval_s=0",
            "gnss.burst_interval_s=0")
# Each second scan, for tests of positions by satellites: half the work, and the path is as good.
HALF_THE_SCANS = ("lidar.keep_every=2",)
SCANS_PER_S = 5
SMALL_STAND = ("stand.size_x_m=40", "stand.size_y_m=40", "stand.trees_per_ha=400")


class Outcome:
    def __init__(self, code, out, said, folder):
        self.code, self.out, self.said, self.folder = code, out, said, folder
        path = folder / "run.json" if folder else None
        self.run = json.loads(path.read_text()) if path and path.exists() else None

    @property
    def warnings(self):
        return {w["key"]: w for w in self.run["warnings"]}

    @property
    def poses(self):
        return (self.folder / "trajectory.tum").read_text().splitlines()


def program(*arguments, **options):
    """The program's outcome; one that hangs fails its own case, not all of them."""
    return subprocess.run([PROGRAM, "--quiet", *map(str, arguments)], capture_output=True, text=True,
                          **{"timeout": 300, **options})


def map_recording(recording, folder, *options, **more):
    """`understory map`, without the finished map unless asked for."""
    done = program("map", recording, "-o", folder, "--threads", 1, "--set", "map.enabled=false",
                   *options, **more)
    assert done.returncode in (0, 3, 4), f"exit code {done.returncode}: {done.stderr}"
    return Outcome(done.returncode, done.stdout, done.stderr, folder)


def snapshot(folder):
    """All that lies below it; of folders that they are there, since working in one changes its time."""
    return {path: path.is_dir() or (os.lstat(path).st_ino, os.lstat(path).st_size, os.lstat(path).st_mtime_ns)
            for path in sorted(folder.rglob("*"))}


SOURCE = pathlib.Path(__file__).resolve().parent.parent.parent
BUILD = pathlib.Path(os.environ.get("UNDERSTORY_BUILD", pathlib.Path(PROGRAM).parent))
CACHE = pathlib.Path(os.environ.get("UNDERSTORY_CACHE", pathlib.Path.home() / ".cache" / "understory"))
KEPT_MAKERS = 2  # what other programs or simulators made is removed when nobody asked for it for an hour


def digest(files, *texts):
    made_by = hashlib.sha256()
    for file in files:
        made_by.update(pathlib.Path(file).read_bytes())
    for text in texts:
        made_by.update(text.encode())
    return made_by.hexdigest()[:12]


@functools.cache
def simulator():
    """What decides the bytes of a simulated recording: the sources of the simulator, and how they were compiled. A program
    that was not built here, or before the sources changed, stands for itself."""
    layers = [SOURCE / "src" / "understory" / layer for layer in ("util", "geometry", "sensor", "recording", "simulation")]
    files = [file for layer in layers for pattern in ("*.cc", "*.h", "*.in", "*.txt") for file in layer.rglob(pattern)
             if not file.name.endswith("_test.cc")]
    files += [SOURCE / "src" / "understory" / "cli" / "simulate.cc", SOURCE / "CMakePresets.json",
              *(SOURCE / "cmake").glob("*.cmake"), *(SOURCE / "configs" / "sites").glob("*.yaml")]
    settings, built = BUILD / "CMakeCache.txt", pathlib.Path(PROGRAM)
    own = settings.is_file() and built.resolve() == (BUILD / "understory").resolve()
    if not own or built.stat().st_mtime < max(file.stat().st_mtime for file in files):
        return digest((PROGRAM,))
    flags = [line for line in settings.read_text().splitlines()
             if line.startswith(("CMAKE_BUILD_TYPE", "CMAKE_CXX", "UNDERSTORY_MARCH", "UNDERSTORY_SANITIZERS", "UNDERSTORY_UNITY"))]
    return digest(sorted(files), *flags)


def made_once(words, make, made_by=None, shared=BUILD / "tests" / "recordings"):
    """A folder that `make(folder)` fills once for all tests. Its name tells `words` and who made it, by default this
    program. What the last ones but two made goes. Tests read what lies there, and write elsewhere."""
    shared.mkdir(parents=True, exist_ok=True)
    name = f"{made_by or digest((PROGRAM, __file__))}-{hashlib.sha256(repr(words).encode()).hexdigest()[:16]}"
    with open(shared / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        asked = {}
        for path in shared.glob("*-*"):
            maker = path.name.split("-")[0]
            asked[maker] = max(asked.get(maker, 0), path.stat().st_mtime)
        for maker in sorted(asked, key=asked.get, reverse=True)[KEPT_MAKERS:]:
            for path in shared.glob(f"{maker}-*") if asked[maker] < time.time() - 3600 else ():
                shutil.rmtree(path) if path.is_dir() else path.unlink()
        own = open(shared / f"{name}.lock", "w")
    with own:
        fcntl.flock(own, fcntl.LOCK_EX)
        if not (shared / name).exists():
            half = pathlib.Path(tempfile.mkdtemp(prefix=f"{name}.", dir=shared))
            make(half)
            half.rename(shared / name)
        os.utime(shared / name)
    return shared / name


def simulated(site, seed, seconds, *settings, name="walk.mcap"):
    """A recording that `simulate` wrote with those settings, its truth beside it in walk.truth. It lies in the cache, for
    all tests of all builds whose simulator is the same. 0 seconds: as long as the route takes."""
    def make(folder):
        done = program("simulate", site, "-o", folder / name, "--seed", seed, "--duration-s", seconds,
                       *(word for setting in settings for word in ("--set", setting)))
        assert done.returncode == 0, done.stderr
    words = ("simulate", site, seed, seconds, *settings, *(() if name == "walk.mcap" else (name,)))
    return made_once(words, make, simulator(), CACHE / "recordings") / name


def unpacked(recording):
    """The same recording in chunks that are not compressed, for read_mcap."""
    def make(folder):
        done = program("convert", recording, folder / "good.mcap", "--compression", "none")
        assert done.returncode == 0, done.stderr
    return made_once(("unpacked", str(recording)), make) / "good.mcap"


def two_runs(recording):
    """The recording mapped by both front ends, and fixes along its path: (run, run by stems, fixes). Shared, to be read."""
    def make(folder):
        run, stems = folder / "run", folder / "stems"
        done = program("map", recording, "-o", run)
        assert done.returncode == 0, done.stderr
        done = program("map", recording, "-o", stems, "--front-end", "sparse")
        assert done.returncode in (0, 4), done.stderr
        (folder / "fixes.csv").write_text("timestamp,latitude_deg,longitude_deg,height_m\n" + "".join(
            f"{line.split()[0]},{62 + float(line.split()[2]) / 111e3:.9f},{29 + float(line.split()[1]) / 52e3:.9f},100\n"
            for line in (run / "trajectory.tum").read_text().splitlines()[::10]))
    made = made_once(("two runs", str(recording)), make)
    return made / "run", made / "stems", made / "fixes.csv"


def reported_walk():
    """A walk with a lidar of 128 rings, mapped straight from the simulator, and the run's full inventory: (run, inventory).
    Shared, to be read."""
    def make(folder):
        for words in (("map", "sim:demo?duration_s=8&seed=4", "-o", folder / "run"),
                      ("inventory", folder / "run", "-o", folder / "inventory")):
            done = program(*words)
            assert done.returncode == 0, done.stderr
    made = made_once(("reported walk",), make)
    return made / "run", made / "inventory"


def unfinished_run(folder, checkpoint=b"half"):
    """A run folder as a killed run leaves it, though with a checkpoint of nothing; the checkpoint."""
    work = folder / ".understory"
    work.mkdir(parents=True)
    (work / "marker").write_text("Understory: work folder of a run\nformat: 1\nversion: 0\n")
    (work / "checkpoint.bin").write_bytes(checkpoint)
    return work / "checkpoint.bin"


def good_recording(seconds=12, seed=5, more=()):
    """Some seconds on foot with a VLP-16 and an IMU: (file, its messages, truth). `more` settings."""
    recording = simulated("demo", seed, seconds, *SITE, *more)
    path = unpacked(recording)
    return path, read_mcap(path), recording.with_suffix(".truth")


def placed_recording(seed=4, seconds=16):
    """A short walk in a small stand, with good fixes; shared by all tests."""
    return simulated("demo", seed, seconds, "lidar.model=VLP-16", *GOOD_SKY, *SMALL_STAND)


def rewritten(path, recording, change):
    """The recording with what `change` makes of each message; without those of which it makes nothing. All topics stay,
    where `unpacked` has one lidar. Needs mcap."""
    from mcap.reader import make_reader

    with open(recording, "rb") as file:
        messages = [Message(channel.topic, schema.name, message.log_time, message.data)
                    for schema, channel, message in make_reader(file).iter_messages()]
    made = [new for message in messages if (new := change(message))]
    write_mcap(path, sorted(made, key=lambda message: message.time))
    return path


def error_m(outcome, truth):
    """Root mean square error of the positions, first poses aligned, and how many were compared."""
    done = program("evaluate", outcome.folder, truth, "--align", "first", "--json")
    assert done.returncode == 0, done.stderr
    errors = json.loads(done.stdout)
    return errors["ape_rmse_m"], errors["pairs"]


class Cases:
    """Named checks, two at a time; all are run, failures are listed at the end."""

    def __init__(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.scratch.name)
        self.cases = []

    def case(self, name):
        def add(function):
            self.cases.append((name, function))
            return function
        return add

    def run(self):
        def attempt(case):
            name, function = case
            folder = self.folder / name.replace(" ", "_").replace("/", "_")
            folder.mkdir()
            try:
                return name, None, function(folder)
            except Exception as error:  # every case is to be seen, whatever the first one does
                return name, f"{type(error).__name__}: {error}", None
        failed = 0
        with concurrent.futures.ThreadPoolExecutor(2) as pool:
            for name, failure, remark in pool.map(attempt, self.cases):
                failed += failure is not None
                print(f"{'FAILED' if failure else 'ok':6} {name}: {failure or remark or ''}")
        self.scratch.cleanup()
        raise SystemExit(1 if failed else 0)
