"""What is no recording, and words that no command knows: refused at once, and nothing is written."""

import json
import pathlib
import shutil
import subprocess

from program import PROGRAM, Cases, program

cases = Cases()
walk = cases.folder / "walk.mcap"
words = [word for setting in ("duration_s=1", "lidar.model=VLP-16", "gnss.enabled=false", "stand.size_x_m=30",
                              "stand.size_y_m=30") for word in ("--set", setting)]
for made in (("simulate", "demo", "-o", walk, *words), ("convert", walk, cases.folder / "clouds"),
             ("map", walk, "-o", cases.folder / "run")):
    done = program(*made)
    assert done.returncode in (0, 4), done.stderr
RUN, CLOUDS = cases.folder / "run", cases.folder / "clouds"


def refused(code, *arguments):
    done = program(*arguments)
    assert done.returncode == code and done.stderr.startswith("error: ") and not done.stdout, (arguments, done)
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    return done.stderr.strip()


# Its map was taken for a scan: a map of one pose, complete.
@cases.case("a run is no recording")
def run_as_recording(folder):
    for recording in (RUN, f"{RUN}/"):
        said = refused(3, "map", recording, "-o", folder / "a")
        assert f"understory inventory {recording} -o DIR" in said, said
    assert not (folder / "a").exists()
    bare = folder / "bare"  # as a run by stems, which makes no cloud
    shutil.copytree(RUN, bare)
    (bare / "map.laz").unlink()
    said = refused(3, "map", bare, "-o", folder / "a")
    assert f"{bare}/run.json" in said and "--resume" not in said, said
    clouds = folder / "clouds"  # of someone who keeps notes of other programs beside the scans
    shutil.copytree(CLOUDS, clouds)
    (clouds / "run.json").write_text("{}")
    assert program("map", clouds, "-o", folder / "b").returncode == 0
    return said.replace(str(folder), "")


@cases.case("one cloud in a folder is one cloud")
def one_cloud(folder):
    scans = folder / "scans"
    scans.mkdir()
    cloud = scans / "000000.pcd"
    shutil.copy(sorted(CLOUDS.glob("*.pcd"))[0], cloud)
    said = refused(3, "map", scans, "-o", folder / "a")
    assert f"understory inventory {cloud}" in said, said
    assert "one point cloud" in refused(3, "map", cloud, "-o", folder / "a")
    assert not (folder / "a").exists()


@cases.case("a path of one pose is not complete")
def one_pose(folder):
    short = folder / "short.mcap"
    assert program("simulate", "demo", "-o", short, *words[2:], "--set", "duration_s=0.15").returncode == 0
    for front_end in ("dense", "sparse"):
        run = folder / front_end
        done = program("map", short, "-o", run, "--front-end", front_end)
        poses = len((run / "trajectory.tum").read_text().splitlines())
        assert poses == 1 and done.returncode == 4 and "single pose" in done.stderr, (poses, done)


# A plot in map coordinates was told that it has no IMU and loses precision.
@cases.case("what a single cloud is told")
def cloud_as_recording(folder):
    cloud = sorted(CLOUDS.glob("*.pcd"))[0]
    done = program("info", cloud)
    assert done.returncode == 0 and f"understory inventory {cloud} -o DIR" in done.stdout, done
    assert "imu" not in done.stdout and "warnings  none" in done.stdout, done.stdout
    assert json.loads(program("info", cloud, "--json").stdout)["one_cloud"] is True
    assert json.loads(program("info", CLOUDS, "--json").stdout)["one_cloud"] is False
    return done.stdout.replace(str(CLOUDS), "")


@cases.case("stems are no recording, a run is no cloud")
def stems_as_recording(folder):
    stems = folder / "walk.stems.csv.gz"
    assert program("convert", walk, stems).returncode == 0
    for arguments in (("info", stems), ("convert", stems, folder / "a.mcap"), ("map", stems, "-o", folder / "a")):
        assert f"understory correct {stems} -o DIR" in refused(3, *arguments), arguments
    said = refused(3, "register", RUN, RUN)
    assert f"for instance {RUN / 'map.laz'}" in said, said
    assert "expected one cloud" in refused(3, "register", CLOUDS, RUN / "map.laz")
    assert sorted(path.name for path in folder.iterdir()) == [stems.name]
    return said.replace(str(RUN), "RUN")


# Figures for `> FILE` were lost with exit code 0.
@cases.case("a full disk behind what is printed")
def full_output(_):
    cloud = sorted(CLOUDS.glob("*.pcd"))[0]
    for words in (("info", walk, "--json"), ("evaluate", RUN, f"{str(walk)[:-5]}.truth"), ("register", cloud, cloud), ("--help",)):
        with open("/dev/full", "w") as full:
            done = subprocess.run([PROGRAM, "--quiet", *map(str, words)], stdout=full, stderr=subprocess.PIPE, text=True)
        assert done.returncode == 3 and "what is printed cannot be written: No space" in done.stderr, (words, done)
    closed = subprocess.run(f'"{PROGRAM}" info "{walk}" >&-', shell=True, stderr=subprocess.PIPE, text=True)
    assert closed.returncode == 0, closed
    return done.stderr.strip()


# They came without the word by which a script knows an error.
@cases.case("words that no command knows")
def unknown_words(folder):
    here = pathlib.Path(folder)
    for arguments, word in ((("map", "--bogus", "x"), "map has no option '--bogus'"),
                            (("mapp",), "did you mean 'map'"),
                            ((), "understory --help"),
                            (("map", "--threads"), "understory map --help"),
                            (("map", walk, "-o", here / "a", "--front-end", "odd"), "--front-end"),
                            (("georeference", RUN, "-o", here / "a"), "--method"),
                            (("map", walk, "more", "words"), "understory map --help"),
                            (("register", walk), "two clouds"),
                            (("inventory", RUN, "-o", here / "a", "--unit-m", "nan"), "--unit-m")):
        said = refused(2, *arguments)
        assert word in said, (arguments, said)
    for page in (("--help",), ("map", "--help"), ("--version",)):
        done = program(*page)
        assert done.returncode == 0 and done.stdout and not done.stderr, page


cases.run()
