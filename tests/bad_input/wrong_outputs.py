"""Ways to name an output wrongly, for every command that writes. Files and folders of others keep their
bytes and their time of change, and nothing is left beside them."""

import fcntl
import gzip
import json
import os
import pathlib
import shutil
import subprocess
import zlib

from program import PROGRAM, Cases, program, unfinished_run

RESULTS = ["trajectory.tum", "odometry.tum", "keyframes.tum", "states.csv.gz", "stems.csv.gz", "graph.g2o", "gnss.csv",
           "global.csv.gz", "steps.csv", "loops.csv", "corrections.csv", "map.laz", "map.copc.laz", "trees.csv", "felled.csv", "cuts.csv", "trees.gpkg",
           "dtm.tif", "dsm.tif", "chm.tif", "obstacles.laz", "free_height.tif", "map.qgs", "deformation.csv", "trajectory_imu.tum", "trajectory_partial.tum",
           "run.json", "report.html"]
OWN_RUN = {"status": "complete", "command": "map", "version": "0"}
cases = Cases()
inputs = cases.folder / "inputs"


def snapshot(folder):
    """Each path below a folder with all that the system says of it but the time of reading. No program can
    write, rename or touch a file and leave the time of its last change (st_ctime) as it was."""
    def tell(path):
        at = os.lstat(path)
        return at.st_mode, at.st_ino, at.st_nlink, at.st_size, at.st_mtime_ns, at.st_ctime_ns
    seen = {str(folder): tell(folder)}
    for top, folders, files in os.walk(folder):
        seen.update({path: tell(path) for path in (os.path.join(top, name) for name in folders + files)})
    return seen


# A second in a few trees.
SMALL_SITE = "duration_s: 1\nlidar:\n  model: VLP-16\nstand:\n  size_x_m: 30\n  size_y_m: 30\n"


def make_inputs():
    """A second of a recording and what else the commands read; each is read to its end by some test."""
    inputs.mkdir()
    walk = inputs / "walk.mcap"
    small = ["duration_s=1", "lidar.model=VLP-16", "stand.size_x_m=30", "stand.size_y_m=30"]
    words = [word for setting in small for word in ("--set", setting)]
    for done in (program("simulate", "demo", "-o", walk, *words), program("convert", walk, inputs / "clouds")):
        assert done.returncode == 0, done.stderr
    run = inputs / "run"
    run.mkdir()
    (run / "run.json").write_text(json.dumps(OWN_RUN))
    (run / "trajectory.tum").write_text("".join(f"{t} {t} {t % 7} 0 0 0 0 1\n" for t in range(60)))
    (run / "trees.csv").write_text("id,x,y,z,dbh_m,dbh_sd_m,height_m,lean_deg,observations,x_sd_m,y_sd_m\n1,2,3,0,0.3,,,,9,,\n")
    with gzip.open(run / "stems.csv.gz", "wt") as file:
        file.write("frame,timestamp,x,y,z\n" + "".join(f"{t},{t},{5 + i - t},{i * i % 7},0\n" for t in range(9)
                                                       for i in range(9)))
    shutil.copy(run / "trees.csv", inputs / "b.csv")
    first = next((inputs / "clouds").glob("*.pcd"))
    shutil.copy(first, inputs / "plot.pcd")
    shutil.copy(first, run / "map.laz")  # read by what is in it
    (inputs / "fixes.csv").write_text("timestamp,latitude_deg,longitude_deg,height_m\n" +
                                      "".join(f"{t},{62 + t * 1e-5},{29 + t % 7 * 1e-5},100\n" for t in range(60)))
    (inputs / "dem.asc").write_text("ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 50\n1 2\n3 4\n")
    (inputs / "site.yaml").write_text(SMALL_SITE)
    (inputs / "settings.yaml").write_text("run:\n  checkpoint_interval_s: 4\n")
    (inputs / "extrinsics.yaml").write_text("body_frame: imu\nbody_from_lidar: {translation_m: [0, 0, 0.1]}\n")
    (inputs / "boxes.yaml").write_text("boxes: []\n")
    (inputs / "head.csv").write_text("timestamp,x,y,z\n")


class Command:
    def __init__(self, name, words, reads, ending=""):
        self.name, self.words, self.ending = name, words, ending
        self.reads = [inputs / name for name in reads]

    def __call__(self, output, *more, **options):
        words = [inputs / word[1:] if str(word).startswith("@") else word for word in self.words]
        words = [output if word == "OUT" else word for word in words]
        return program(*words, *more, timeout=120, **options)


def setting(key, name):
    return f"{key}={inputs / name}"


FOLDERS = [
    Command("map", ["map", "@walk.mcap", "-o", "OUT", "--config", "@settings.yaml", "--extrinsics", "@extrinsics.yaml",
                    "--set", setting("preprocess.machine_boxes_file", "boxes.yaml")],
            ["walk.mcap", "settings.yaml", "extrinsics.yaml", "boxes.yaml"]),
    Command("map of clouds", ["map", "@clouds", "-o", "OUT", "--metadata", "@settings.yaml"], ["clouds", "settings.yaml"]),
    Command("map by stems", ["map", "@walk.mcap", "-o", "OUT", "--front-end", "sparse", "--set",
                             setting("harvester.head_log", "head.csv")], ["walk.mcap", "head.csv"]),
    Command("map of a site", ["map", f"sim:{inputs}/site.yaml", "-o", "OUT"], ["site.yaml"]),
    Command("correct", ["correct", "@run/stems.csv.gz", "-o", "OUT", "--set", setting("harvester.head_log", "head.csv")],
            ["run/stems.csv.gz", "head.csv"]),
    Command("correct a run", ["correct", "@run", "-o", "OUT"], ["run"]),
    Command("inventory", ["inventory", "@plot.pcd", "-o", "OUT"], ["plot.pcd"]),
    Command("inventory of a run", ["inventory", "@run", "-o", "OUT"], ["run"]),
    Command("georeference", ["georeference", "@run", "--method", "gnss-path", "--gnss", "@fixes.csv", "-o", "OUT"],
            ["run", "fixes.csv"]),
    Command("georeference on terrain", ["georeference", "@run", "--method", "terrain", "--dem", "@dem.asc", "--start", 0, 0,
                                        0, "-o", "OUT"], ["run", "dem.asc"]),
    Command("merge", ["merge", "@run", "@b.csv", "-o", "OUT", "--reference", "@run/trees.csv"], ["run", "b.csv"]),
    Command("demo", ["demo", "-o", "OUT"], []),
]
FILES = [
    Command("convert to mcap", ["convert", "@walk.mcap", "OUT", "--extrinsics", "@extrinsics.yaml"],
            ["walk.mcap", "extrinsics.yaml"], ".mcap"),
    Command("convert clouds", ["convert", "@clouds", "OUT"], ["clouds"], ".mcap"),
    Command("convert to stems", ["convert", "@walk.mcap", "OUT"], ["walk.mcap"], ".csv.gz"),
    Command("convert a cloud to stems", ["convert", "@plot.pcd", "OUT"], ["plot.pcd"], ".csv.gz"),
    Command("simulate", ["simulate", "@site.yaml", "-o", "OUT"], ["site.yaml"], ".mcap"),
    Command("simulate a capture", ["simulate", "@site.yaml", "-o", "OUT", "--set", "lidar.model=VLP-16", "--set",
                                   "lidar.range_step_m=0.002"], ["site.yaml"], ".pcap"),
]
# A folder of clouds takes no --overwrite: it is never replaced.
CLOUDS = [Command("convert to clouds", ["convert", "@walk.mcap", "OUT"], ["walk.mcap"]),
          Command("convert clouds to clouds", ["convert", "@clouds", "OUT", "--format", "ply"], ["clouds"])]
ALL = FOLDERS + FILES + CLOUDS
ways = set()


def expect_refused(command, way, output, box, *more, codes=(3,), **options):
    """The command is refused, says why, and nothing in the box or among the inputs is changed or added."""
    ways.add(way)
    before = snapshot(box), snapshot(inputs)
    done = command(output, *more, **options)
    assert done.returncode in codes, f"{command.name}, {way}: exit {done.returncode}: {done.stdout}{done.stderr}"
    assert done.stderr.startswith("error: "), (command.name, way, done.stderr)
    after = snapshot(box), snapshot(inputs)
    changed = [path for a, b in zip(before, after) for path in sorted(set(a) | set(b)) if a.get(path) != b.get(path)]
    assert not changed, f"{command.name}, {way}: {changed} changed; said: {done.stderr}"
    return done.stderr


def or_over(command, way):
    """--overwrite for every other command of a way and every other way of a command."""
    return ("--overwrite",) if command not in CLOUDS and (zlib.crc32(way.encode()) + ALL.index(command)) % 2 else ()


def refused_by_all(commands, way, output, box, *more, **options):
    for command in commands:
        expect_refused(command, way, output, box, *or_over(command, way), *more, **options)


def home(folder, *names):
    place = folder / "home"
    place.mkdir(parents=True)
    for name in names:
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_text("mine")
    return place


@cases.case("a file by the name of a result")
def result_names(folder):
    for turn, name in enumerate(RESULTS):
        place = home(folder / name, name)
        # Every name for two commands, two names for every command.
        commands = FOLDERS if turn in (10, 19) else [FOLDERS[turn % len(FOLDERS)], FOLDERS[-2]]
        refused_by_all(commands, f"own {name}", place, folder)


@cases.case("a home folder with all of these names")
def full_home(folder):
    place = home(folder, *RESULTS, "work/checkpoint.bin", "notes.txt")
    for way, output, where in (("home", place, None), ("home/", f"{place}/", None), (".", ".", place), ("./", "./", place),
                               ("sub/..", "work/..", place), ("..", "..", place / "work"),
                               ("a relative name", "home", folder), ("home/.", f"{place}/.", None)):
        refused_by_all(FOLDERS if way == "home" else FOLDERS[6:11], way, output, folder, cwd=where)
    (folder / "link").symlink_to(place)
    (folder / "link2").symlink_to("link")
    for way in ("link", "link2", "link/", "link/work/.."):
        refused_by_all(FOLDERS[6:11], f"home by {way}", f"{folder}/{way}", folder)
    for way in ("with spaces in it", "with\na line break", "with-ümläuts-и-森林", "with 'quotes\"", "-o", "100%", "*"):
        named = folder / f"home {way}"
        shutil.copytree(place, named)
        refused_by_all(FOLDERS[8:11], f"a name {way!r}", named, folder)


@cases.case("a result's name on something else than a file")
def odd_results(folder):
    for way, make in (("a folder named map.laz", lambda at: (at / "map.laz").mkdir()),
                      ("a pipe named run.json", lambda at: os.mkfifo(at / "run.json")),
                      ("a link named trees.csv", lambda at: (at / "trees.csv").symlink_to(inputs / "b.csv")),
                      ("a link to nothing named report.html", lambda at: (at / "report.html").symlink_to("nothing"))):
        place = home(folder / way)
        make(place)
        refused_by_all(FOLDERS[4:], way, place, folder)


@cases.case("run.json of another program")
def other_run_json(folder):
    for turn, text in enumerate(("", "mine", "[]", "{}", "null", '{"command": "train.py", "version": "1"}',
                                 '{"command": "map"}', '{"command": 3, "status": 4, "version": 5}', "{" * 9000,
                                 '{"status": "complete", "command": "map", "version": ""}')):
        place = home(folder / str(turn))
        (place / "run.json").write_text(text)
        (place / "map.laz").write_text("mine")
        refused_by_all(FOLDERS if turn == 5 else FOLDERS[8:11], f"run.json {text[:20]!r}", place, folder)


@cases.case("work folder of another program")
def other_work(folder):
    def newer(at):
        (at / ".understory").mkdir()
        (at / ".understory" / "marker").write_text("Understory: work folder of a run\nformat: 2\n")

    def foreign(at):
        unfinished_run(at).with_name("marker").write_text("Overstory\nformat: 1\n")

    for way, make in ((".understory without a marker", lambda at: (at / ".understory" / "mine").mkdir(parents=True)),
                      (".understory with another marker", foreign), (".understory of a newer version", newer),
                      ("a file .understory", lambda at: (at / ".understory").write_text("mine")),
                      ("a link .understory", lambda at: (at / ".understory").symlink_to(inputs / "run"))):
        place = folder / way / "run"
        place.mkdir(parents=True)
        make(place)
        refused_by_all(FOLDERS, way, place, folder)


@cases.case("runs")
def runs(folder):
    finished = folder / "finished"
    finished.mkdir()
    (finished / "run.json").write_text(json.dumps(OWN_RUN | {"files": ["run.json", "map.laz"]}))
    (finished / "map.laz").write_text("of the run")
    unfinished_run(folder / "unfinished")
    for command in FOLDERS:
        said = expect_refused(command, "a finished run", finished, folder)
        assert "--overwrite" in said, said
        said = expect_refused(command, "an unfinished run", folder / "unfinished", folder)
        assert "--resume" in said, said
    refused_by_all(CLOUDS, "a finished run", finished, folder)
    (finished / "dtm.tif").write_text("mine, laid beside the run's")
    refused_by_all(FOLDERS, "own file beside those of a run", finished, folder)


@cases.case("a run that is at work")
def locked(folder):
    checkpoint = unfinished_run(folder / "run")
    with open(checkpoint.with_name("lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        refused_by_all(FOLDERS, "a run at work", folder / "run", folder)
        resume = Command("resume", ["map", "--resume", "OUT"], [])
        expect_refused(resume, "a run at work, resumed", folder / "run", folder)
    for way, place in (("resume nothing", folder / "none"), ("resume a file", checkpoint), ("resume inputs", inputs)):
        expect_refused(resume, way, place, folder)


@cases.case("no folder")
def no_folder(folder):
    (folder / "file").write_text("mine")
    os.mkfifo(folder / "pipe")
    (folder / "nowhere").symlink_to("nothing")
    (folder / "round").symlink_to("round")
    (folder / "link to a file").symlink_to("file")
    for way, output in (("a file", "file"), ("a file with a slash", "file/"), ("below a file", "file/run"),
                        ("far below a file", "file/a/b/run"), ("a pipe", "pipe"), ("below a pipe", "pipe/run"),
                        ("a link to nothing", "nowhere"), ("a link to itself", "round"), ("below it", "round/run"),
                        ("a link to a file", "link to a file"), ("a name that is too long", "n" * 300)):
        refused_by_all(FOLDERS + CLOUDS, way, f"{folder}/{output}", folder)
    for way, output in (("/dev/null", "/dev/null"), ("below /dev/null", "/dev/null/run"), ("/proc", "/proc/run")):
        refused_by_all(FOLDERS[5:] + CLOUDS, way, output, folder)
    refused_by_all(ALL, "an empty name", "", folder, codes=(2,))
    if os.geteuid() != 0:
        place = home(folder)
        place.chmod(0o500)
        refused_by_all(ALL, "a folder that may not be written", place / "x", folder)


@cases.case("no file")
def no_file(folder):
    (folder / "file").write_text("mine")
    for command in FILES:
        name = f"{command.name}{command.ending}"
        named = {}
        for way in ("a file", "a folder", "a pipe", "a link to a file", "a link to nothing", "a link to /dev/null"):
            named[way] = folder / f"{way.replace('/', '_')} {name}"
        named["a file"].write_text("mine")
        named["a folder"].mkdir()
        (named["a folder"] / "mine").write_text("mine")
        os.mkfifo(named["a pipe"])
        named["a link to a file"].symlink_to("file")
        named["a link to nothing"].symlink_to("nothing")
        named["a link to /dev/null"].symlink_to("/dev/null")
        named["below a file"] = folder / "file" / name
        named["in no folder"] = folder / "none" / name
        named["a name that is too long"] = folder / ("n" * 300 + command.ending)
        for way, output in named.items():
            expect_refused(command, f"{way} for a file", output, folder)
            if "a file" != way and "link to a file" not in way:
                expect_refused(command, f"{way} for a file", output, folder, "--overwrite")
        for ending in (".las", ".csv", ".bag", ".pcap.gz"):
            expect_refused(command, f"an ending {ending}", folder / f"wrong{ending}", folder, codes=(2,))


@cases.case("standard streams that are closed")
def closed_streams(folder):
    # Their numbers went to the next files that were opened, and words of the program into these.
    for streams in (">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-"):
        output = folder / "closed.mcap"
        done = subprocess.run(["sh", "-c", f'"$@" {streams}', "sh", PROGRAM, "simulate", "demo", "-o", output, "--overwrite",
                               "--duration-s", "1", "--set", "lidar.columns=100"], timeout=120)
        assert done.returncode == 0, f"{streams}: exit code {done.returncode}"
        assert output.read_bytes().startswith(b"\x89MCAP0\r\n"), f"{streams}: the recording begins with words"


@cases.case("what lies beside a simulated recording")
def beside_simulated(folder):
    for command in FILES[-2:]:
        output = folder / f"walk{command.ending}"
        truth = folder / "walk.truth"
        truth.mkdir()
        (truth / "notes.txt").write_text("mine")
        for more in ((), ("--overwrite",)):
            expect_refused(command, "own files in REC.truth", output, folder, *more)
        (truth / "notes.txt").rename(truth / "trees.csv")
        expect_refused(command, "own trees.csv in REC.truth", output, folder)
        shutil.rmtree(truth)
        truth.write_text("mine")
        for more in ((), ("--overwrite",)):
            expect_refused(command, "a file REC.truth", output, folder, *more)
        truth.unlink()
    for name in ("walk.nmea", "walk.extrinsics.yaml"):
        (folder / name).write_text("mine")
        expect_refused(FILES[-1], f"own {name}", folder / "walk.pcap", folder)
        (folder / name).unlink()
    # A site that would be replaced by what belongs to its recording.
    site = folder / "walk.extrinsics.yaml"
    site.write_text(SMALL_SITE)
    own = Command("simulate its own site", ["simulate", site, "-o", "OUT", "--set", "lidar.model=VLP-16"], [])
    for more in ((), ("--overwrite",)):
        assert "which is read" in expect_refused(own, "a site's own name", folder / "walk.pcap", folder, *more)


@cases.case("a folder that holds things, for clouds")
def clouds_into(folder):
    for way, name in (("a folder of clouds", "000000.pcd"), ("a folder with times.txt", "times.txt"), ("a folder with notes", "n")):
        refused_by_all(CLOUDS, way, home(folder / way, name), folder)


def names_of(path, folder):
    """Other ways to say where a file or folder lies: each with the folder that holds it."""
    link = folder / "link to inputs"
    if not link.exists():
        link.symlink_to(inputs)
    below = path.relative_to(inputs)
    yield "the input", path
    yield "the input by ..", path.parent / ".." / path.parent.name / path.name
    yield "the input by a linked folder", link / below
    yield "the input by a relative name", os.path.relpath(path, folder)
    yield "the input with two slashes", str(path).replace("/", "//")
    if path.is_dir():
        yield "the input with a slash", f"{path}/"
        yield "the input with a dot", f"{path}/."
        yield "in the input", path / "run"
        yield "far in the input", path / "a" / "b" / "run"
        yield "in the input by a linked folder", link / below / "run"
    yield "what holds the input", path.parent
    yield "what holds the input by a link", link / below.parent
    yield "what holds what holds the input", inputs.parent


@cases.case("the input, in it, around it")
def inputs_as_outputs(folder):
    said = 0
    for command in FOLDERS + CLOUDS:
        for path in command.reads:
            for way, output in names_of(path, folder):
                words = expect_refused(command, way, output, folder, *or_over(command, way), cwd=folder)
                assert "which is read" in words, (command.name, way, words)
                said += 1
    for command in FILES:
        for path in command.reads:
            link, hard = folder / f"link{command.ending}", folder / f"hard{command.ending}"
            link.symlink_to(path)
            outputs = [("a link to the input", link)]
            if path.is_file():
                hard.hardlink_to(path)
                outputs.append(("a hard link to the input", hard))
            else:
                outputs += [("in the input", path / f"x{command.ending}"),
                            ("a file of the input by a link", folder / f"part{command.ending}")]
                outputs[-1][1].symlink_to(next(path.glob("*.pcd")))
            if path.name.endswith(command.ending):
                outputs += [("the input", path), ("the input by ..", path.parent / ".." / path.parent.name / path.name)]
            for way, output in outputs:
                words = expect_refused(command, way, output, folder, *or_over(command, way))
                assert "which is read" in words, (command.name, way, words)
                said += 1
            for _, output in outputs:
                if output.parent == folder:
                    output.unlink()
    return f"{said} refusals"


@cases.case("places that are lawful")
def lawful(folder):
    """Odd names and other files are no reason to refuse; nothing of others is touched then either."""
    merge = FOLDERS[-2]
    for turn, name in enumerate(("with spaces", "with\na line break", "森林", "a/b/c", "deep/../other", "ends.in.dots...")):
        box = folder / str(turn)
        place = home(box, "notes.txt", "work/checkpoint.bin", "former-1/map.laz")
        before = snapshot(box)
        done = merge(place / name)
        assert done.returncode in (0, 4), done.stderr
        made = pathlib.Path(os.path.normpath(place / name))
        assert (made / "trees.csv").exists() and not (made / ".understory").exists()
        same = {p: v for p, v in snapshot(box).items() if p in before and p != str(place)}
        assert all(before[p] == v for p, v in same.items())
        into = merge(place)  # among files that bear no names of results
        assert into.returncode in (0, 4), into.stderr
        after = snapshot(box)
        assert all(after[p] == v for p, v in before.items() if p != str(place)), name
    (folder / "empty").mkdir()
    (folder / "link").symlink_to("empty")
    assert merge(folder / "link").returncode in (0, 4) and (folder / "empty" / "trees.csv").exists()
    assert merge(folder / "link", "--overwrite").returncode in (0, 4)


@cases.case("files of single names, replaced when asked")
def replaced(folder):
    for command in FILES[:2] + FILES[-2:-1]:
        output = folder / f"{command.name}{command.ending}"
        assert command(output).returncode == 0
        whole = output.read_bytes()
        expect_refused(command, "what the command has made before", output, folder)
        done = command(output, "--overwrite")
        assert done.returncode == 0 and output.read_bytes() == whole, done.stderr
    assert not list(folder.glob(".*")), list(folder.glob(".*"))


make_inputs()
try:
    cases.run()
finally:
    print(f"{len(ways)} ways, {len(ALL)} commands")
