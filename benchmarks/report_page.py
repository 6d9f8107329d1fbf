"""How fast report.html opens and moves in Chromium, and how large it is: report_page.py [--trees N] [RUN].

Without a run it makes a stand of N trees (3,000) as a cloud and takes its inventory. Seconds are those
of the main thread of the page, which do not depend on what else the machine does. Those by the clock
stand beside them."""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "output"))
import chromium  # noqa: E402

SPACING_M = 4.2
FRAMES = 100
PAN = """new Promise((done) => {{ const map = selection.map; const times = []; let last = 0; let count = 0;
map.showAll(); map.zoomMiddle({zoom}); function step(now) {{ if (last) times.push(now - last); last = now;
map.move(count % 40 < 20 ? 9 : -9, 3); count += 1;
if (count <= {frames}) requestAnimationFrame(step); else done(times.sort((a, b) => a - b)); }} requestAnimationFrame(step); }})"""


def ground(x, y):
    return 3 * np.sin(x / 60) + 2 * np.cos(y / 45)


def stand(count, path):
    """A cloud of stems seen from different sides, crowns and ground."""
    import laspy
    rng = np.random.default_rng(1)
    side = int(np.ceil(np.sqrt(count)))
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    places = (np.stack([x.ravel(), y.ravel()], 1)[:count] + 0.5) * SPACING_M + rng.uniform(-1.2, 1.2, (count, 2))
    flat = rng.uniform(0, side * SPACING_M, (int((side * SPACING_M) ** 2 * 8), 2))
    parts = [np.column_stack([flat, ground(*flat.T) + rng.normal(0, 0.02, len(flat))])]
    for place in places:
        dbh = rng.uniform(0.09, 0.5)
        height = 6 + 40 * dbh
        points = rng.choice([600, 900, 1500])
        level = rng.uniform(0.1, min(8, 0.5 * height), points)
        angle = rng.uniform(0, 2 * np.pi) + rng.uniform(0, np.radians(rng.choice([360, 240, 150])), points)
        away = 0.5 * dbh * (1 - 0.03 * (level - 1.3)) + rng.normal(0, 0.012, points)
        parts.append(np.column_stack([place[0] + away * np.cos(angle), place[1] + away * np.sin(angle),
                                      level + ground(*place)]))
        share = rng.uniform(0.35, 1, 400)
        away = (1 - share) * 2 * np.sqrt(rng.uniform(0, 1, 400)) + 0.02
        angle = rng.uniform(0, 2 * np.pi, 400)
        parts.append(np.column_stack([place[0] + away * np.cos(angle), place[1] + away * np.sin(angle),
                                      share * height + ground(*place)]))
    cloud = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    cloud.header.scales = [0.001] * 3
    cloud.x, cloud.y, cloud.z = np.concatenate(parts).T
    cloud.write(path)


def measure(page):
    with chromium.Browser() as browser:
        clock_s = browser.open(page)
        browser.wait()
        print(f"{page}: {os.path.getsize(page) / 1e6:.1f} MB, {browser.run('selection.map.map.trees.length')} trees")
        print(f"opened: {browser.cpu_s():.2f} s of the main thread, {clock_s:.2f} s by the clock")
        for zoom in (1.2, 6):
            before = browser.cpu_s()
            times = browser.run(PAN.format(zoom=zoom, frames=FRAMES))
            print(f"moved, zoomed {zoom} times: {1e3 * (browser.cpu_s() - before) / FRAMES:.1f} ms of the main thread a "
                  f"frame; {times[len(times) // 2]:.0f} ms from frame to frame (median), {times[-1]:.0f} ms at most")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", nargs="?", help="a run folder; else one is made")
    parser.add_argument("--trees", type=int, default=3000)
    given = parser.parse_args()
    if given.run:
        return measure(Path(given.run) / "report.html")
    program = os.environ.get("UNDERSTORY_PROGRAM", "build/understory")
    with tempfile.TemporaryDirectory() as scratch:
        stand(given.trees, f"{scratch}/stand.laz")
        subprocess.run([program, "--quiet", "inventory", f"{scratch}/stand.laz", "-o", f"{scratch}/run"], check=True)
        return measure(Path(scratch) / "run" / "report.html")


if __name__ == "__main__":
    main()
