"""The installed program runs from wherever its tree is moved to. It finds its profiles, sites and
coordinate systems, and names no folder that it was built in or linked from. It says the version of
CMakeLists.txt and CHANGELOG.md."""

import json
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ["UNDERSTORY_BUILD"])
CACHE = os.environ.get("UNDERSTORY_CACHE", str(Path.home() / ".cache" / "understory"))


def run(*words, **options):
    # Nothing of this machine's settings reaches the program but where programs are.
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True,
                          env={"PATH": "/usr/bin:/bin", "LANG": "C.UTF-8"}, **options)
    assert done.returncode == 0, f"{words}: exit code {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout


def installed_in(folder):
    """The tree below /usr, staged and then moved."""
    subprocess.run(["cmake", "--install", BUILD, "--prefix", "/usr"], check=True, capture_output=True,
                   env={**os.environ, "DESTDIR": str(folder / "stage")})
    shutil.move(folder / "stage" / "usr", folder / "another place")
    shutil.rmtree(folder / "stage")
    return folder / "another place"


def check_version(program):
    wanted = re.search(r"^project\(understory VERSION ([\d.]+)", (TOP / "CMakeLists.txt").read_text(), re.M)[1]
    changes = re.search(r"^## ([\d.]+)", (TOP / "CHANGELOG.md").read_text(), re.M)[1]
    said = run(program, "--version").strip()
    assert said == wanted == changes, (said, wanted, changes)


def check_places(program):
    """Libraries are found by the system, and nothing in the program leads to what it was built in or linked from."""
    entries = re.findall(r"\((RPATH|RUNPATH|NEEDED)\).*\[(.*)\]", run("readelf", "-d", program))
    assert [name for kind, name in entries if kind == "NEEDED" and name.startswith("libgdal")], entries
    wrong = [entry for entry in entries if entry[0] != "NEEDED" or "/" in entry[1]]
    assert not wrong, wrong
    content = program.read_bytes()
    for folder in (BUILD, Path(CACHE)):
        at = content.find(str(folder).encode() + b"/")
        assert at < 0, f"the program names {folder}: {content[at:at + 120]}"


def check_runs(program, tree, folder):
    shipped = {path.stem for path in (TOP / "configs" / "profiles").glob("*.yaml")}
    assert len(shipped) >= 4 and shipped == {p.stem for p in tree.glob("share/understory/configs/profiles/*.yaml")}
    for profile in shipped:
        assert "voxel_size_m" in run(program, "map", "--profile", profile, "--print-config", cwd=folder)
    assert "harvester" in run(program, "simulate", "--list", cwd=folder)
    run(program, "simulate", "demo", "--seed", 3, "--duration-s", 8, "-o", "walk.mcap", "--set", "lidar.columns=256",
        cwd=folder)
    done = subprocess.run([program, "map", "walk.mcap", "-o", "run"], cwd=folder, env={}, capture_output=True, text=True)
    assert done.returncode in (0, 4), done.stderr
    told = json.loads((folder / "run" / "run.json").read_text())
    assert "EPSG" in json.dumps(told), "without PROJ's data there is no coordinate system"
    assert (folder / "run" / "report.html").stat().st_size > 10000


with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    tree = installed_in(folder)
    program = tree / "bin" / "understory"
    check_version(program)
    check_places(program)
    check_runs(program, tree, folder)
    assert (tree / "share" / "doc" / "understory" / "copyright").exists()
print("installed, moved, ran")
