"""Pairs of scans by our matchers, by PCL's NDT and by kiss-matcher, one after the other on one core.

    registration_peers.py [--scans DIR] [--rounds 3]      ./run bench registration-peers

NDT runs on the first two KITTI scans of UNDERSTORY_DATA: the same thinning (0.25 m) and cells (1 m),
no guess. CPU time is the least of the rounds, of preparation and alignment. kiss-matcher runs on the
scans of DIR, or on simulated ones of harvester (16 rings), beside our search without a guess. Right is
within 0.5 m and 2 degrees. PCL comes as Debian's packages, unpacked into the cache and not installed.
kiss-matcher comes from PyPI, with the hashes of its lock file, into an environment of its own.
"""

import argparse
import json
import os
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BUILD = Path(os.environ.get("UNDERSTORY_BUILD", ROOT / "build")) / "benchmarks"
CACHE = Path(os.environ.get("UNDERSTORY_CACHE", Path.home() / ".cache" / "understory")) / "peers"
DATA = Path(os.environ.get("UNDERSTORY_DATA", ROOT.parent / "shared" / "data"))
PCL = ["libpcl-dev"] + [f"libpcl-{part}1.13" for part in (
    "registration", "common", "kdtree", "search", "features", "filters", "octree",
    "sample-consensus")] + ["libflann1.9", "libflann-dev"]
KISS_MATCHER = "benchmarks/peers/registration/kiss-matcher.txt"


def pcl_ndt():
    """The program of peers/pcl_ndt.cc and the folder of its libraries, built once."""
    folder = CACHE / "pcl-1.13"
    libraries = folder / "root/usr/lib/x86_64-linux-gnu"
    program = folder / "pcl_ndt"
    if not program.exists():
        folder.mkdir(parents=True, exist_ok=True)
        subprocess.run(["apt-get", "download", *PCL], cwd=folder, check=True)
        for package in sorted(folder.glob("*.deb")):
            subprocess.run(["dpkg", "-x", package, folder / "root"], check=True)
        # As Debian builds its packages: wider vectors would change the layout of Eigen's types.
        names = [f"-l:{library.name}" for library in sorted(libraries.glob("libpcl_*.so.1.13"))]
        subprocess.run(
            ["c++", "-O3", "-DNDEBUG", "-std=c++17", "-w", f"-I{folder}/root/usr/include/pcl-1.13",
             f"-I{folder}/root/usr/include", "-I/usr/include/eigen3",
             ROOT / "benchmarks/registration/peers/pcl_ndt.cc", "-o", program, f"-L{libraries}",
             *names, "-l:libflann_cpp.so.1.9", "-llz4"],
            env={**os.environ, "LD_LIBRARY_PATH": str(libraries)}, check=True)
    return program, libraries


def kiss_matcher_python():
    made = subprocess.run([ROOT / "tools/python-env.sh", KISS_MATCHER], check=True,
                          capture_output=True, text=True)
    return made.stdout.split()[-1]


def lines_of(command, **others):
    done = subprocess.run(["taskset", "-c", "0", *map(str, command)], check=True,
                          capture_output=True, text=True, **others)
    return [json.loads(line) for line in done.stdout.splitlines()]


def compare_ndt(rounds):
    program, libraries = pcl_ndt()
    pair = [DATA / "kitti00_0-3" / f"00000{i}.bin" for i in (0, 1)]
    theirs, ours = [], []
    for _ in range(rounds):
        theirs += lines_of([program, *pair, 0.25, 1.0, 1],
                           env={**os.environ, "LD_LIBRARY_PATH": str(libraries)})
        ours += lines_of([BUILD / "registration_benchmark", *pair, 1])
    peer = min(row["prepare_ms"] + row["align_ms"] for row in theirs)
    own = min(row["thin_ms"] + row["map_ms"] + row["ndt_ms"] for row in ours)
    print(f"NDT, whole pair, CPU ms: ours {own:.1f}, PCL {peer:.1f}, ratio {peer / own:.1f}; "
          f"translation {ours[0]['translation_m']}, {theirs[0]['translation_m']}")


def compare_global(folder):
    peer = lines_of([kiss_matcher_python(),
                     ROOT / "benchmarks/registration/peers/kiss_matcher_pairs.py", folder],
                    env={**os.environ, "OMP_NUM_THREADS": "1"})
    own = lines_of([BUILD / "verdict_pairs", folder, folder, "global", 1])
    for name, rows in (("ours", own), ("kiss-matcher", peer)):
        right = sum(row["off_m"] < 0.5 and row["off_deg"] < 2.0 for row in rows)
        print(f"without a guess, {name}: {right} of {len(rows)} right, "
              f"CPU {sum(row['ms'] for row in rows) / max(1, len(rows)):.0f} ms a pair")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scans", type=Path, help="scans and poses, as pair_scans writes them")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    compare_ndt(options.rounds)
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.scans or Path(scratch) / "harvester"
        if not options.scans:
            subprocess.run([BUILD / "pair_scans", "harvester", "13", "24", folder], check=True)
        compare_global(folder)


if __name__ == "__main__":
    main()
