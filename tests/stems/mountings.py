"""A body whose axes point anywhere (benchmarks/mounting.py). Path and trees are as good as those of an
upright one, with all points and by stems, with an IMU and without. The report says how up is known."""

import sys
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "benchmarks"))

import mounting  # noqa: E402

NEAR_M = 0.01
# z of the body points up, down, and to both sides.
TURNS = {"dense": (12,), "stems": (5, 12), "stems_alone": (12, 20)}
SAID = {"stems": "The vertical is known from gravity, by the IMU, and from the stems.",
        "stems_alone": "The vertical is known from the stems alone."}


def check(condition, what):
    if not condition:
        sys.exit(f"mountings: {what}")


def main(work):
    recording = mounting.recorded(work, 5, 8)
    downs = [mounting.orientations()[turn][2][2] for turns in TURNS.values() for turn in turns]
    check(set(downs) == {0, -1}, f"z of the bodies: {downs}")
    for way, turns in TURNS.items():
        first = None
        for number, code, error, (trees, tree_error) in mounting.runs(recording, work, way, turns):
            first = first or (error, tree_error, trees)
            said = f"{way}, turn {number}: exit code {code}, path {error:.4f} m, {trees} trees {tree_error:.4f} m"
            print(said)
            check(code == 0 and abs(error - first[0]) < NEAR_M and abs(tree_error - first[1]) < NEAR_M, said)
            check(trees > 0.9 * first[2], said)
            report = (work / f"{way}{number}" / "report.html").read_text()
            for other, text in SAID.items():
                check((text in report) == (other == way), f"{said}: the report says of up: {text}")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        main(Path(folder))
