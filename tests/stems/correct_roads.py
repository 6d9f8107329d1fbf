"""`understory correct` from end to end: made-up strip roads against their truth, one and two
threads, and input that is damaged or in the wrong place."""

import csv
import gzip
import json
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
import strip_roads
from program import CACHE, Cases, digest, made_once, program

# Everything but these is the same bytes for any number of threads: they hold times and memory.
TIMED = {"run.json", "report.html"}


def driven(seed, second_look=False, **roads):
    """Strip roads as strip_roads.py writes them: the folder, and how many views it holds. It lies in the cache, for all
    tests that ask for the same."""
    def make(folder):
        strip_roads.write_strip_roads(folder, seed, strip_roads.Roads(**roads), second_look)
    made_by = digest((strip_roads.__file__,), sys.version)
    folder = made_once((seed, second_look, *roads.items()), make, made_by, CACHE / "strip_roads")
    return folder, len((folder / "truth" / "trajectory.tum").read_text().splitlines())


cases = Cases()
SITE, VIEWS = driven(3)
STEMS = SITE / "stems.csv.gz"
# One road of 60 m, where it does not matter what the map is like.
SMALL, SMALL_VIEWS = driven(7, roads=1, length_m=60.0)
LINES = gzip.decompress(STEMS.read_bytes()).decode().splitlines()


def table(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def correct(stems, run, *options):
    return program("correct", stems, "-o", run, *options)


def evaluated(*arguments):
    done = program("evaluate", *arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def lean_deg(run):
    """Mean angle between where up is in the answer's frame and where it really is, tilt only."""
    def ups(path):
        for line in path.read_text().splitlines():
            if line.startswith("#"):
                continue
            x, y, z, w = map(float, line.split()[4:])
            yield 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    pairs = zip(ups(run / "trajectory.tum"), ups(SITE / "truth" / "trajectory.tum"))
    angles = [math.degrees(math.acos(min(1.0, sum(a * b for a, b in zip(u, v))))) for u, v in pairs]
    return sum(angles) / len(angles)


@cases.case("strip roads against their truth")
def roads(folder):
    done = correct(STEMS, folder / "run", "--threads", 2)
    assert done.returncode == 0, done.stderr
    run = folder / "run"
    told = json.loads((run / "run.json").read_text())
    assert told["status"] == "complete" and told["poses"] == VIEWS, told["reasons"]
    path = evaluated(run, SITE / "truth", "--align", "se3")
    assert path["pairs"] == VIEWS
    segments = {s["length_m"]: s["translation_plane_percent"] for s in path["segments"]}
    longest = max(segments)
    assert path["ape_plane_rmse_m"] < 0.12, path["ape_plane_rmse_m"]
    assert segments[longest] < 0.2, segments  # 0.2 m in 100 m
    assert lean_deg(run) < 1.0, lean_deg(run)
    # The map became sharper by few corrections, nearly as sharp as the true poses would make it.
    figures, counts = told["quality"], told["counts"]
    # (beta is what a correction looks at: that it falls would tell nothing.)
    for figure in ("box_dimension_{}", "registration_noise_{}_m"):
        assert figures[figure.format("after")] < figures[figure.format("before")], figure
    assert 10 < counts["corrections"] <= 0.04 * VIEWS, counts
    ours, best = (evaluated("map", STEMS, t) for t in (run, SITE / "truth"))
    for figure in ("registration_noise_m", "registration_noise_mean_m"):
        assert ours[figure] < 1.2 * best[figure], (figure, ours[figure], best[figure])
    assert len(ours["roads"]) == 2 and all(r["consistency"] > 0.9 for r in ours["roads"]), ours
    trees = evaluated("trees", run / "trees.csv", SITE / "truth" / "trees.csv", "--align", "yaw")
    assert trees["recall"] > 0.75 and trees["position_rmse_m"] < 0.25, trees
    return (f"{100 * path['ape_plane_rmse_m']:.0f} cm in the plane over {path['length_m']:.0f} m, "
            f"{trees['recall']:.0%} of the trees, to {100 * trees['position_rmse_m']:.0f} cm")


@cases.case("every method of correction")
def methods(folder):
    """From plain frame-to-frame odometry, on a small site: none leaves the map worse.

    A method ends where its own map is sharpest. So the map is judged by stems that no method has
    seen: a second look at the same trees, placed by the corrected poses.
    """
    site, views = driven(5, second_look=True, length_m=120.0)
    said, noise = [], {}
    for method in ("none", "powers", "powers_printed", "lattice", "pose_graph",
                   "gaussian_process", "expected_gain"):
        run = folder / method
        done = correct(site / "stems.csv.gz", run, "--set", f"correction.method={method}",
                       "--set", "odometry.target=frame")
        assert done.returncode in (0, 4), done.stderr
        told = json.loads((run / "run.json").read_text())
        assert told["poses"] == views
        rows = table(run / "corrections.csv")
        kept = sum(int(row["kept"]) for row in rows)
        assert kept == told["counts"]["corrections"] and len(rows) >= kept
        sharpness = evaluated("map", site / "second_look.csv.gz", run)
        noise[method] = sharpness["registration_noise_mean_m"]
        errors = evaluated(run, site / "truth", "--align", "se3")
        said.append((method, errors["ape_plane_rmse_m"]))
    errors = dict(said)
    assert errors["expected_gain"] < 0.5 * errors["none"], errors
    assert errors["powers"] < errors["none"], errors
    assert errors["gaussian_process"] < 0.8 * errors["none"], errors
    for method, share in (("powers", 0.85), ("powers_printed", 0.95), ("lattice", 1.0),
                          ("pose_graph", 0.8), ("gaussian_process", 0.85), ("expected_gain", 0.75)):
        assert noise[method] < share * noise["none"], (method, noise)
    return ", ".join(f"{method} {100 * error:.0f} cm, noise {100 * noise[method]:.1f} cm"
                     for method, error in said)


@cases.case("same bytes with one thread and with two")
def threads(folder):
    for count in (1, 2):
        assert correct(SMALL / "stems.csv.gz", folder / str(count), "--threads", count).returncode == 0
    names = {p.name for p in (folder / "1").iterdir()}
    assert names == {p.name for p in (folder / "2").iterdir()} and len(names - TIMED) >= 4, names
    for name in names - TIMED:
        assert (folder / "1" / name).read_bytes() == (folder / "2" / name).read_bytes(), name
    return ", ".join(sorted(names - TIMED))


@cases.case("odometry from view to view by branch and bound in a small box")
def go_icp(folder):
    """P1's sSLAM beside P0's ICP; each step says how well it fits."""
    site, views = driven(8, roads=1, length_m=60.0)
    plane, searched = [], []
    for matcher in ("icp", "go_icp"):
        run = folder / matcher
        done = correct(site / "stems.csv.gz", run, "--set", f"odometry.matcher={matcher}", "--set",
                       "odometry.target=frame", "--set", "correction.method=none", "--set", "close_loops=false")
        assert done.returncode in (0, 4), done.stderr
        head, *rows = (line.split(",") for line in (run / "steps.csv").read_text().splitlines())
        rows = [dict(zip(head, row)) for row in rows]
        assert len(rows) == views and rows[0]["status"] == "first" and not rows[0]["error_m"], rows[0]
        for row in rows[1:]:
            assert abs(float(row["overlap"]) + float(row["outlier_ratio"]) - 1.0) < 2e-3, row
            assert 0.0 < float(row["error_m"]) < 2.0 and row["status"] in ("tracked", "searched", "weak"), row
        quality = json.loads((run / "run.json").read_text())["quality"]
        mean = sum(float(row["error_m"]) for row in rows[1:]) / (views - 1)
        assert abs(quality["match_error_mean_m"] - mean) < 1e-4, (quality["match_error_mean_m"], mean)
        searched.append(sum(row["status"] == "searched" for row in rows))
        plane.append(evaluated(run, site / "truth", "--align", "se3")["ape_plane_rmse_m"])
    assert plane[1] < plane[0] + 0.05 and searched[1] < searched[0], (plane, searched)
    return (f"ICP {100 * plane[0]:.1f} cm and {searched[0]} searches, Go-ICP {100 * plane[1]:.1f} cm "
            f"and {searched[1]}, of {views} views")


@cases.case("views that hurt the map are left out of it")
def eliminated(folder):
    """One view in ten is put 0.35 m beside its place among the scans of a run."""
    site, run, views = SMALL, folder / "run", SMALL_VIEWS
    run.mkdir()
    (run / "stems.csv.gz").write_bytes((site / "stems.csv.gz").read_bytes())
    (run / "run.json").write_text('{"command": "map", "version": "0.1.0", "status": "complete", "reasons": []}')
    lines = [line.split() for line in (site / "truth" / "trajectory.tum").read_text().splitlines()
             if line[0] != "#"]
    hurt = len([k for k in range(views) if k % 10 == 5])
    (run / "trajectory.tum").write_text("\n".join(
        " ".join([row[0], row[1], str(float(row[2]) + (0.35 if k % 10 == 5 else 0.0)), *row[3:]])
        for k, row in enumerate(lines)) + "\n")
    sights, noise = [], []
    for factor in (0, 4):
        done = correct(run, folder / str(factor), "--set", "correction.method=none", "--set",
                       "close_loops=false", "--set", f"correction.eliminate_factor={factor}",
                       "--set", "correction.eliminate_share=0.2")
        assert done.returncode == 0, done.stderr
        told = json.loads((folder / str(factor) / "run.json").read_text())
        assert told["counts"]["views_eliminated"] == (hurt if factor else 0), told["counts"]
        sights.append(sum(int(row["observations"]) for row in table(folder / str(factor) / "trees.csv")))
        noise.append(told["quality"]["sight_noise_m"])
        assert len((folder / str(factor) / "trajectory.tum").read_text().splitlines()) == views
    assert noise[1] < 0.8 * noise[0], (sights, noise)
    return f"{hurt} of {views} views, sights {100 * noise[0]:.0f} to {100 * noise[1]:.0f} cm from their trees"


@cases.case("a run is corrected from its own trajectory on")
def run_again(folder):
    """The start is what the run says, here the truth with a bend; every pose of it is corrected."""
    run = folder / "run"
    site, views = driven(6, roads=1, length_m=60.0)
    run.mkdir()
    (run / "stems.csv.gz").write_bytes((site / "stems.csv.gz").read_bytes())
    (run / "run.json").write_text('{"command": "map", "version": "0.1.0", "status": "complete", "reasons": []}')
    true = [list(map(float, line.split())) for line in
            (site / "truth" / "trajectory.tum").read_text().splitlines() if line[0] != "#"]
    bend = [0.6 * (k / views) ** 2 for k in range(views)]
    rows, between = [], 0
    for k, row in enumerate(true):
        rows.append([row[0], row[1], row[2] + bend[k], *row[3:]])
        if k + 1 < views:  # scans that were not kept as views
            rows.append([0.5 * (row[0] + true[k + 1][0]), 0.5 * (row[1] + true[k + 1][1]),
                         0.5 * (row[2] + true[k + 1][2] + bend[k] + bend[k + 1]), *row[3:]])
            between += 1
    (run / "trajectory.tum").write_text(
        "\n".join(f"{row[0]:.9f} " + " ".join(f"{v:.6f}" for v in row[1:]) for row in rows) + "\n")
    for name in ("none", "expected_gain"):
        done = correct(run, folder / name, "--set", f"correction.method={name}", "--set",
                       "close_loops=false")
        assert done.returncode == 0, done.stderr
    assert len((folder / "none" / "trajectory.tum").read_text().splitlines()) == views + between
    begun = evaluated(folder / "none", run / "trajectory.tum")
    assert begun["pairs"] == views + between and begun["ape_max_m"] < 1e-4, begun
    told = json.loads((folder / "none" / "run.json").read_text())
    assert told["poses"] == views + between, told["poses"]
    assert {Path(i["file"]).name for i in told["inputs"]} == {"stems.csv.gz", "trajectory.tum"}, told["inputs"]
    errors = [evaluated(folder / name / "trajectory.tum", site / "truth", "--align", "se3")
              ["ape_plane_rmse_m"] for name in ("none", "expected_gain")]
    assert errors[1] < 0.7 * errors[0], errors
    # Never into the folder that it reads, whoever has made what lies there.
    before = (run / "trajectory.tum").read_bytes()
    for stems in (run, run / "stems.csv.gz"):
        for options in ((), ("--overwrite",)):
            done = correct(stems, run, *options)
            assert done.returncode == 3 and str(run) in done.stderr, done.stderr
    assert (run / "trajectory.tum").read_bytes() == before
    (run / "trajectory.tum").write_text("1 0 0 0 0 0 0 1\n")
    done = correct(run, folder / "late")
    assert done.returncode == 3 and "trajectory.tum" in done.stderr and "view 0" in done.stderr, done
    (run / "stems.csv.gz").unlink()
    done = correct(run, folder / "empty")
    assert done.returncode == 3 and "--front-end sparse" in done.stderr, done.stderr
    return f"{100 * errors[0]:.1f} to {100 * errors[1]:.1f} cm in the plane"


def refused(path, run, *words):
    done = correct(path, run)
    assert done.returncode == 3 and done.stderr.startswith(f"error: {path}"), done.stderr
    for word in words:
        assert word in done.stderr, (word, done.stderr)
    assert not (run / "trajectory.tum").exists()
    return done.stderr.strip().replace(str(path), path.name)


def spoilt(folder, change):
    lines = list(LINES[:2000])
    change(lines)
    path = folder / "stems.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@cases.case("stream cut short")
def cut(folder):
    path = folder / "stems.csv.gz"
    path.write_bytes(STEMS.read_bytes()[:60_000])
    return refused(path, folder / "run", "line ", "gzip")


@cases.case("stream with a flipped bit")
def flipped(folder):
    path = folder / "stems.csv.gz"
    data = bytearray(STEMS.read_bytes())
    data[len(data) // 2] ^= 0x10
    path.write_bytes(data)
    return refused(path, folder / "run", "line ")


@cases.case("column missing")
def column(folder):
    path = spoilt(folder, lambda lines: lines.__setitem__(0, lines[0].replace(",y,", ",why,")))
    return refused(path, folder / "run", "line 1", "'y'")


@cases.case("time goes backwards")
def backwards(folder):
    def swap(lines):
        at = next(i for i, line in enumerate(lines) if line.startswith("9,"))
        lines[at] = lines[at].replace(",4.50,", ",0.25,", 1)
        lines[1:] = lines[1:at + 1]
        swap.line = len(lines)
    path = spoilt(folder, swap)
    return refused(path, folder / "run", f"line {swap.line}", "timestamp")


@cases.case("a position that is no number")
def not_a_number(folder):
    def put(lines):
        cells = lines[700].split(",")
        cells[3] = "nan"
        lines[700] = ",".join(cells)
    return refused(spoilt(folder, put), folder / "run", "line 701")


@cases.case("nothing but a header")
def empty(folder):
    return refused(spoilt(folder, lambda lines: lines.__delitem__(slice(1, None))), folder / "run",
                   "at least one row")


@cases.case("a single view is no map")
def one_view(folder):
    last = max(i for i, line in enumerate(LINES) if line.startswith("0,"))
    path = folder / "stems.csv"
    path.write_text("\n".join(LINES[:last + 1]) + "\n")
    done = correct(path, folder / "run")
    assert done.returncode == 4 and "1 views" in done.stderr, (done.returncode, done.stderr)
    assert len((folder / "run" / "trajectory.tum").read_text().splitlines()) == 1


@cases.case("no such file")
def absent(folder):
    return refused(folder / "stems.csv.gz", folder / "run", "no such file or folder")


@cases.case("folder of a mapping run that is not finished")
def unfinished(folder):
    run = folder / "run"
    work = run / ".understory"
    work.mkdir(parents=True)
    (work / "marker").write_text("Understory: work folder of a run\nformat: 1\n")
    (work / "checkpoint.bin").write_bytes(b"half")
    done = correct(SMALL / "stems.csv.gz", run)
    assert done.returncode == 3 and str(run) in done.stderr, done.stderr
    assert (work / "checkpoint.bin").read_bytes() == b"half"
    assert correct(SMALL / "stems.csv.gz", run, "--overwrite").returncode == 0
    assert (run / "trajectory.tum").exists() and not work.exists()
    return done.stderr.strip().replace(str(run), run.name)


@cases.case("stems without axes, times and diameters")
def bare(folder):
    """Only frame, x, y, z are needed: without axes the z axis of the sensor is taken as up."""
    site, _ = driven(4, roads=1, tilt_deg=0.2)
    rows = [line.split(",") for line in
            gzip.decompress((site / "stems.csv.gz").read_bytes()).decode().splitlines()]
    path = folder / "stems.csv"
    path.write_text("\n".join(",".join((r[0], r[2], r[3], r[4])) for r in rows) + "\n")
    done = correct(path, folder / "run")
    assert done.returncode == 0, done.stderr
    # Times are the frames' numbers, in seconds; the truth's are half of them.
    truth = [line.split(" ") for line in (site / "truth" / "trajectory.tum").read_text().splitlines()]
    (folder / "truth.tum").write_text("\n".join(" ".join([f"{k}.0", *t[1:]])
                                                for k, t in enumerate(truth)) + "\n")
    errors = evaluated(folder / "run" / "trajectory.tum", folder / "truth.tum", "--align", "se3")
    assert errors["ape_plane_rmse_m"] < 0.3, errors["ape_plane_rmse_m"]
    return f"{100 * errors['ape_plane_rmse_m']:.0f} cm in the plane"


cases.run()
