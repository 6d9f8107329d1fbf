"""`understory inventory` of a cloud in tiles on disk. It finds the trees of the cloud in one piece,
whatever the tiles and threads are. Without room in memory or on the disk nothing is left behind."""

import resource
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import PROGRAM, program

SAME = ("trees.csv", "stem_curves.csv", "dead_wood.csv", "dtm.tif", "chm.tif", "dsm.tif")


def ground(x, y):
    return 100 + 0.08 * x + 0.4 * np.sin(0.3 * x) * np.cos(0.2 * y)


def stand(seed):
    """Points of 80 m by 14 m with stems, also at borders of tiles, crowns and undergrowth."""
    random = np.random.default_rng(seed)

    def spread(count, low, high):
        x, y = random.uniform(0, 80, count), random.uniform(0, 14, count)
        return np.column_stack([x, y, ground(x, y) + random.uniform(low, high, count)])

    parts = [spread(40_000, -0.03, 0.03), spread(6_000, 0.3, 3.0)]
    for i in range(20):
        x, y = 3 + 3.9 * i + random.uniform(-1, 1), random.uniform(2, 12)
        if i % 6 == 0:
            x = 20.0 * (i // 6)
        height, turn = random.uniform(0.1, 5.0, 3000), random.uniform(0, 2 * np.pi, 3000)
        radius = random.uniform(0.05, 0.2) - 0.006 * (height - 1.3) + random.normal(0, 0.004, 3000)
        parts.append(np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn), ground(x, y) + height]))
        parts.append(np.column_stack([random.normal(x, 0.8, 500), random.normal(y, 0.8, 500),
                                      ground(x, y) + random.uniform(4.5, 14, 500)]))
    points = np.concatenate(parts)
    return points[random.permutation(len(points))]


def write(path, points):
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = [400_000, 6_900_000, 0], [0.001] * 3
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = (points + [400_000, 6_900_000, 0]).T
    cloud.intensity = np.arange(len(points)) % 60_000
    cloud.gps_time = np.arange(len(points)) * 1e-3
    cloud.write(path)


def labelled(folder):
    """The rows of map.laz in the order of their times, each once."""
    cloud = laspy.read(folder / "map.laz")
    rows = np.column_stack([cloud.gps_time, cloud.X, cloud.Y, cloud.Z, cloud.intensity, cloud.classification,
                            cloud.tree_id, cloud.HeightAboveGround])
    return rows[np.argsort(cloud.gps_time, kind="stable")]


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "stand.laz"
        write(path, stand(7))

        def inventory(run, *options):
            done = program("inventory", path, "-o", folder / run, *options)
            assert done.returncode == 0, (run, done.returncode, done.stderr)
            return folder / run

        whole = inventory("whole")
        rows = labelled(whole)
        assert len((whole / "trees.csv").read_text().splitlines()) > 15
        assert len(np.unique(rows[:, 6])) > 15, "points of trees"
        for tile in (200, 40, 25, 17.3):
            run = inventory(f"tiles{tile}", "--set", f"tiles.size_m={tile}")
            for file in SAME:
                assert (run / file).read_bytes() == (whole / file).read_bytes(), (tile, file)
            assert np.array_equal(labelled(run), rows, equal_nan=True), tile
            assert sorted(p.name for p in run.iterdir()) == sorted(p.name for p in whole.iterdir()), tile
        one = inventory("one", "--set", "tiles.size_m=25", "--threads", 1)
        for file in (*SAME, "map.laz", "trees.gpkg"):
            assert (one / file).read_bytes() == (folder / "tiles25" / file).read_bytes(), file

        done = program("inventory", path, "-o", folder / "small", "--max-memory-mb", 100)
        assert done.returncode == 2 and "max_memory_mb" in done.stderr, (done.returncode, done.stderr)
        assert not (folder / "small").exists()

        def small_files():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, 1_000_000))

        full = subprocess.run([PROGRAM, "--quiet", "inventory", path, "-o", folder / "full", "--set",
                               "tiles.size_m=25"], capture_output=True, text=True, preexec_fn=small_files, timeout=300)
        assert full.returncode == 3 and "temporary file" in full.stderr, (full.returncode, full.stderr)
        assert not (folder / "full").exists()


main()
