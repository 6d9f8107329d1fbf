"""Table 1 of P1 (benchmarks/strip_road_table.py) of made-up roads. Each way of mapping has its cells in its own
columns. The mapping range ends before the first ring with too few trees. Roads are placed by their paths."""

import math
import sys
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "benchmarks"))

import strip_road_table as table  # noqa: E402
from figures.road_jobs import WAYS, road_jobs_of  # noqa: E402


def check(condition, what):
    if not condition:
        sys.exit(f"strip_road_table: {what}")


def ring(number, recall, expected=10):
    return {"from_m": 5 * number, "to_m": 5 * number + 5, "recall": recall, "precision": 0.5, "expected": expected,
            "reported": 4}


def road(site, number):
    gnss = {"gnss_fixes_mean_m": number, "gnss_fit_rms_m": number, "gnss_along_rms_m": number}
    return {"site": site, "way_m": 175.0, "map_kb": number, "plane_cm": number, "space_cm": number,
            "segment": number, "gnss": {"ours": gnss, "truth": gnss}, "height_cm": [number, number], "range_m": 20,
            "terrain": {"terrain_rms_before_m": number, "terrain_rms_m": number}, "memory_mb": number, "cpu_ms": number,
            "rings": [ring(0, 0.01 * number), ring(1, 0.0, 0)]}


def by_stems(site, number):
    return road(site, number) | {"views": 7, "kb": 1000.0 * number, "axis_deg": 1.7, "before_cm": [number, number], "share": number,
                                 "sharp": [(number, number, number, number)] * 3}


def columns():
    roads = [by_stems("lieksa1", 11), by_stems("lieksa2", 12)]
    points = [road("lieksa1", 21) | {"cloud_kb": 31.0}, road("lieksa2", 22) | {"cloud_kb": 32.0}]
    pair = {"trees_a": 3, "trees_b": 4, "as_placed": 0.5, "moved": 0.6, "in_parts": 0.7}
    page = table.page_of("head", roads, points, [("a pair", pair)])
    rows = {line.split("|")[1].strip(): [cell.strip() for cell in line.split("|")[2:-1]] for line in page.splitlines()
            if line.startswith("| ")}
    check(rows[""][:3] == ["lieksa1, by stems", "lieksa2, by stems", "P1, sSLAM"], f"columns are {rows['']}")
    wide = [line for line in page.split("\n\n")[1].splitlines()]
    check(len({line.count("|") for line in wide}) == 1, "rows of the first table are equally wide")
    told = rows["the same in plane over the longest segments, %"]
    check(told == ["11.00", "12.00", "0.41 to 0.5", "21.00", "22.00", "0.5"], f"of both ways: {told}")
    check(rows["cloud that stems are found in, kB per 100 m"] == ["", "", "", "31", "32", "63,000"], "clouds")
    check(rows["vertical angular noise of stems, degrees"] == ["1.7", "1.7", "2.0", "", "", ""], "noise of axes")
    check(rows["a pair"] == ["3, 4", "50.0 %", "60.0 %", "70.0 %"], f"consistency: {rows['a pair']}")
    check(rows["lieksa2 by all points: standing trees found, %"] == ["22.0", ""], "a ring without trees is empty")


def ranges():
    check(table.mapping_range_m([ring(0, 0.9), ring(1, 0.86), ring(2, 0.84), ring(3, 0.9)]) == 10, "mapping range")
    check(table.mapping_range_m([ring(0, 0.0, 0), ring(1, 0.9)]) == 10, "a ring without trees does not end it")


def places():
    with tempfile.TemporaryDirectory() as scratch:
        run, truth = Path(scratch) / "run", Path(scratch) / "truth"
        for folder, turn, shift in ((run, 0.0, (0.0, 0.0)), (truth, 0.5, (3.0, -2.0))):
            folder.mkdir()
            c, s = math.cos(turn), math.sin(turn)
            lines = [f"{t} {c * x - s * y + shift[0]} {s * x + c * y + shift[1]} {0.1 * (t % 2) * (folder == run)} 0 0 0 1"
                     for t, (x, y) in enumerate([(0, 0), (5, 0), (9, 3), (12, 8)])]
            (folder / "trajectory.tum").write_text("\n".join(lines) + "\n")
        x, y, yaw = table.start_of(run, truth)
        check(abs(x - 3) < 1e-9 and abs(y + 2) < 1e-9 and abs(yaw - math.degrees(0.5)) < 1e-9, f"start {x} {y} {yaw}")
        check(abs(table.height_sd_m(run, truth) - 0.05) < 1e-9, "heights differ by their deviation about the mean")


def jobs():
    made = road_jobs_of(["lieksa2"], 22, 60.0)
    check([way for _, way in made] == list(WAYS), "each road is mapped both ways")
    check("registration.method=loam_ground" in made["lieksa2", "loam"].arguments, "the second way is LeGO-LOAM's method")
    check(made["lieksa2", "stems"].recording.name == "lieksa2_seed22_60s", "both from one recording")


if __name__ == "__main__":
    columns()
    ranges()
    places()
    jobs()
    print("table 1 of P1 has its cells")
