"""packaging/copyright names every library that is compiled into the program. Those are archives that are
linked in, and packages whose headers are used without a shared library. Asks ninja what the program is
made of."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ["UNDERSTORY_BUILD"])
# The licence of GCC's library excepts what is compiled into programs; glibc's and Linux's headers hold facts.
COMPILER = re.compile(r"^(gcc-\d+|glibc|linux|googletest|google-benchmark|benchmark)$")
if not all(shutil.which(tool) for tool in ("ninja", "dpkg-query")) or not (BUILD / "build.ninja").exists():
    print("skipped: needs ninja and dpkg")
    sys.exit(77)


def output_of(*words):
    return subprocess.run(words, capture_output=True, text=True, check=False).stdout


def source_packages(paths):
    """Debian's source packages of files. dpkg may know a file by its place before /usr was merged."""
    paths = {os.path.realpath(path) for path in paths}
    names = set()
    both = sorted(paths | {path.removeprefix("/usr") for path in paths})
    for at in range(0, len(both), 500):
        names |= set(re.findall(r"^([\w.+-]+)[:,]", output_of("dpkg-query", "-S", *both[at:at + 500]), re.M))
    found = output_of("dpkg-query", "-W", "-f", "${source:Package}\\n", *sorted(names)) if names else ""
    return set(found.split())


def archives_linked():
    """Names of archives of others: from the cache as libNAME.a, from packages as their source package."""
    command = output_of("ninja", "-C", str(BUILD), "-t", "commands", "understory").splitlines()[-1]
    archives = {path for path in re.findall(r"(?<!\S)(/\S+\.a)\b", command) if not path.startswith(f"{BUILD}/")}
    cached = {path for path in archives if not path.startswith(("/usr/", "/lib/"))}
    return {Path(path).stem.removeprefix("lib") for path in cached} | source_packages(archives - cached)


def headers_used():
    """Paths outside of the project that the program's files include."""
    inputs = output_of("ninja", "-C", str(BUILD), "-t", "inputs", "understory").split()
    objects = {path for path in inputs if path.endswith((".o", ".gch"))}
    assert len(objects) > 50, objects
    used, wanted = set(), False
    for line in output_of("ninja", "-C", str(BUILD), "-t", "deps").splitlines():
        if line and not line.startswith(" "):
            wanted = line.split(":")[0] in objects
        elif wanted and line.strip().startswith("/usr/"):
            used.add(line.strip())
    assert len(used) > 500, len(used)
    return used


def loaded():
    libraries = re.findall(r"=> (/\S+)", output_of("ldd", os.environ["UNDERSTORY_PROGRAM"]))
    needed = set(re.findall(r"\(NEEDED\).*\[(.*)\]", output_of("readelf", "-d", os.environ["UNDERSTORY_PROGRAM"])))
    return source_packages(path for path in libraries if Path(path).name in needed)


text = (TOP / "packaging" / "copyright").read_text()
named = {name for line in re.findall(r"source package (.*)\.$", text, re.M) for name in line.split(" or ")}
linked, headers, shared = archives_linked(), source_packages(headers_used()), loaded()
assert {"gdal", "onetbb"} <= shared, shared
compiled_in = linked | {name for name in headers - shared if not COMPILER.match(name)}
assert {"eigen3", "nanoflann", "cli11", "nlohmann-json3"} <= compiled_in, compiled_in
assert compiled_in <= named, f"packaging/copyright does not name {sorted(compiled_in - named)}"
# Each licence that a paragraph names has its text.
used = set(re.findall(r"^Copyright: .*(?:\n .*)*\nLicense: (\S+)$", text, re.M))
texts = set(re.findall(r"^License: (\S+)\n ", text, re.M))
assert len(used) >= 5 and used == texts, (used, texts)
print("compiled in:", ", ".join(sorted(compiled_in)), "- loaded:", ", ".join(sorted(shared)))
