"""`understory map --front-end sparse` from end to end: a harvester's scans of 16 rings against their
truth. Also single views against what each scan really got of each stem, threads, captures and wrong
use."""

import csv
import gzip
import json
import math
import os
import sys
import time
from array import array
from collections import defaultdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program, simulated
from recordings import read_mcap, write_mcap

TIMED = {"run.json", "report.html"}

cases = Cases()
REC = simulated("lieksa2", 5, 40)
TRUTH = REC.with_suffix(".truth")


def sparse(recording, run, *options):
    return program("map", recording, "-o", run, "--front-end", "sparse", *options)


def evaluated(*arguments):
    done = program("evaluate", *arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def poses(path):
    rows = (line.split() for line in path.read_text().splitlines() if not line.startswith("#"))
    return {row[0]: [float(v) for v in row[1:]] for row in rows}


def placed(pose, point):
    x, y, z, qx, qy, qz, qw = pose
    px, py, pz = point
    tx, ty, tz = 2 * (qy * pz - qz * py), 2 * (qz * px - qx * pz), 2 * (qx * py - qy * px)
    return (x + px + qw * tx + qy * tz - qz * ty, y + py + qw * ty + qz * tx - qx * tz,
            z + pz + qw * tz + qx * ty - qy * tx)


RUN = cases.folder / "run"
FIRST = sparse(REC, RUN, "--threads", 2)


@cases.case("the way, against the truth")
def way(folder):
    assert FIRST.returncode == 0, FIRST.stderr
    told = json.loads((RUN / "run.json").read_text())
    truth = poses(TRUTH / "trajectory.tum")
    assert told["command"] == "map" and told["status"] == "complete", told["reasons"]
    assert told["scans"] == told["poses"] == len(truth) 
    assert 4 < told["counts"]["views"] < len(truth) / 3, told["counts"]
    assert set(poses(RUN / "trajectory.tum")) == set(poses(RUN / "odometry.tum")) == set(truth)
    errors = evaluated(RUN, TRUTH, "--align", "se3")
    assert errors["pairs"] == len(truth)
    assert errors["ape_plane_rmse_m"] < 0.04, errors["ape_plane_rmse_m"]
    return f"{100 * errors['ape_plane_rmse_m']:.1f} cm over {errors['length_m']:.0f} m"


@cases.case("the rate of positioning follows the motion")
def pace(folder):
    told = json.loads((RUN / "run.json").read_text())
    positioned = told["counts"]["scans_positioned"]
    assert 0.1 * told["scans"] < positioned < 0.8 * told["scans"], (positioned, told["scans"])
    done = sparse(REC, folder / "all", "--set", "stems.pace.longest_gap_s=0")
    assert done.returncode == 0, done.stderr
    every = json.loads((folder / "all" / "run.json").read_text())
    assert every["counts"]["scans_positioned"] == every["scans"] == told["scans"], every["counts"]
    errors = [evaluated(run, TRUTH, "--align", "se3")["ape_plane_rmse_m"]
              for run in (folder / "all", RUN)]
    assert errors[1] < errors[0] + 0.01, errors
    for rule in ("overlap", "region"):
        done = sparse(REC, folder / rule, "--set", f"stems.keep.rule={rule}")
        assert done.returncode == 0, done.stderr
        counts = json.loads((folder / rule / "run.json").read_text())["counts"]
        assert counts["views"] != told["counts"]["views"], counts
    return f"{positioned} of {told['scans']} scans, {100 * errors[1]:.1f} cm (each: {100 * errors[0]:.1f})"


@cases.case("figures of the papers in the report")
def report(folder):
    page = (RUN / "report.html").read_text()
    for figure in ("Pairs of views before the correction", "Which views were matched again",
                   "Every sight of every stem", "All pairs of views", "Trees over the distance from the path"):
        assert f"<h3>{figure}</h3>" in page, figure
    assert page.count("data:image/png;base64,") == 7, page.count("data:image/png;base64,")
    # All of the recording, not from the first view that was kept to the last.
    told = json.loads((RUN / "run.json").read_text())
    assert f"{told['recording_s']:.1f} s</" in page, told["recording_s"]


@cases.case("the recording's own fixes place the layers and leave the path alone")
def fixes(folder):
    rows = list(csv.DictReader((RUN / "gnss.csv").open()))
    placed = json.loads((RUN / "run.json").read_text())["georeference"]["on_globe"]
    assert len(rows) > 30 and ("1" in {row["used"] for row in rows}) == placed, len(rows)
    quality = json.loads((RUN / "run.json").read_text())["quality"]
    if "gnss_plane_rms_m" not in quality:  # 40 s are too short a way to fit
        assert not placed and all(row["reason"] for row in rows), rows[0]
        return rows[0]["reason"]
    assert 0 < quality["gnss_plane_rms_m"] < 10, quality
    return f"fit {quality['gnss_plane_rms_m']:.2f} m"


@cases.case("trees, against the truth")
def trees(folder):
    errors = evaluated("trees", RUN / "trees.csv", TRUTH / "trees.csv", "--align", "se3")
    assert errors["matched"] > 100 and errors["precision"] > 0.85, errors
    assert errors["position_rmse_m"] < 0.12 and errors["dbh_rmse_m"] < 0.025, errors
    return (f"{errors['precision']:.0%} of {errors['trees_a']} right, to "
            f"{100 * errors['position_rmse_m']:.1f} cm, diameters to {100 * errors['dbh_rmse_m']:.1f} cm")


@cases.case("views, against what each scan got of each stem")
def views(folder):
    """Moved to the scan's stamp by the odometry's own motion, in the middle of a swing too."""
    truth = poses(TRUTH / "trajectory.tum")
    trees = {r["id"]: (float(r["x"]), float(r["y"]))
             for r in csv.DictReader((TRUTH / "trees.csv").open())}
    returns = defaultdict(dict)
    for row in csv.DictReader(gzip.open(TRUTH / "returns.csv.gz", "rt")):
        returns[row["timestamp"]][row["tree_id"]] = int(row["rings_with_3"])
    stems = defaultdict(list)
    for row in csv.DictReader(gzip.open(RUN / "stems.csv.gz", "rt")):
        stems[row["timestamp"]].append(tuple(float(row[k]) for k in "xyz"))
    clear = found = near = right = 0
    squares = 0.0
    for stamp, points in stems.items():
        key = next(k for k in truth if abs(float(k) - float(stamp)) < 1e-4)
        here = truth[key]
        at = [placed(here, p) for p in points]
        for tree, rings in returns[key].items():
            x, y = trees[tree]
            if rings < 2 or math.hypot(x - here[0], y - here[1]) > 15.0:
                continue
            clear += 1
            found += any(math.hypot(p[0] - x, p[1] - y) < 0.4 for p in at)
        for p in at:
            if math.hypot(p[0] - here[0], p[1] - here[1]) > 15.0:
                continue
            near += 1
            off = min(math.hypot(p[0] - x, p[1] - y) for x, y in trees.values())
            right += off < 0.4
            squares += off * off if off < 0.4 else 0.0
    rmse = math.sqrt(squares / right)
    assert clear > 200, clear
    assert found > 0.97 * clear and right > 0.95 * near and rmse < 0.06, (found / clear, right / near, rmse)
    mean = sum(map(len, stems.values())) / len(stems)
    assert 80 < mean < 200, mean
    return (f"{found / clear:.1%} of {clear} found, {right / near:.1%} right, feet to "
            f"{100 * rmse:.1f} cm, {mean:.0f} stems a view")


@cases.case("correct from its stems alone")
def again(folder):
    done = program("correct", RUN / "stems.csv.gz", "-o", folder / "again")
    assert done.returncode == 0, done.stderr
    errors = evaluated(folder / "again", TRUTH, "--align", "se3")
    assert errors["ape_plane_rmse_m"] < 0.06, errors["ape_plane_rmse_m"]


@cases.case("the harvester's log of its head tells which tree fell")
def head_log(folder):
    done = program("correct", RUN, "-o", folder / "run", "--set", f"harvester.head_log={TRUTH}/head.csv")
    assert done.returncode == 0, done.stderr
    cuts = list(csv.DictReader((folder / "run" / "cuts.csv").open()))
    falls = {row["id"]: row for row in csv.DictReader((folder / "run" / "felled.csv").open())}
    felled = {row["felled_at"]: row for row in csv.DictReader((TRUTH / "trees.csv").open())
              if row["felled_at"]}
    listed = {row["id"]: row for row in csv.DictReader((folder / "run" / "trees.csv").open())}
    assert cuts and len(cuts) == len(felled), (cuts, felled)
    stamp, begin = next(iter(poses(folder / "run" / "trajectory.tum").items()))
    true_begin = poses(TRUTH / "trajectory.tum")[stamp]
    turned_back = [0, 0, 0, *(-v for v in true_begin[3:6]), true_begin[6]]
    for cut in cuts:
        tree = felled[cut["timestamp"]]
        in_body = placed(turned_back, [float(tree[k]) - v for k, v in zip("xyz", true_begin)])
        place, found = placed(begin, in_body), listed[cut["tree_id"]]
        assert math.dist(place[:2], (float(found["x"]), float(found["y"]))) < 0.3, (place, found)
        fall = falls[cut["tree_id"]]
        assert fall["seen_until"] == fall["gone_since"] == cut["timestamp"], fall
        assert abs(float(found["missing_since"]) - float(cut["timestamp"])) < 1e-3, found
    # Without a log and a profile nobody fells: what is gone is missing.
    assert not list(csv.DictReader((RUN / "felled.csv").open()))
    counts = json.loads((RUN / "run.json").read_text())["counts"]
    missing = [row for row in csv.DictReader((RUN / "trees.csv").open()) if row["missing_since"]]
    assert counts["trees_felled"] == 0 and counts["trees_missing"] == len(missing), counts
    log = folder / "log.csv"
    log.write_text((TRUTH / "head.csv").read_text() + "1,2,3\n")
    done = sparse(REC, folder / "refused", "--set", f"harvester.head_log={log}")
    assert done.returncode == 3 and "log.csv" in done.stderr and "line" in done.stderr, done
    assert not (folder / "refused").exists()
    return f"{len(cuts)} cuts, {float(cuts[0]['distance_m']):.2f} m from the tree"


@cases.case("same bytes with one thread and with two")
def threads(folder):
    done = sparse(REC, folder / "one", "--threads", 1)
    assert done.returncode == 0, done.stderr
    names = {p.name for p in RUN.iterdir()}
    assert names == {p.name for p in (folder / "one").iterdir()}
    assert {"stems.csv.gz", "trajectory.tum", "odometry.tum", "trees.csv"} <= names - TIMED, names
    for name in names - TIMED:
        assert (RUN / name).read_bytes() == (folder / "one" / name).read_bytes(), name


@cases.case("a scanner's capture")
def capture(folder):
    rec = simulated("lieksa2", 5, 40, name="field.pcap")
    done = sparse(rec, folder / "run", "--extrinsics", rec.with_suffix(".extrinsics.yaml"))
    assert done.returncode == 0, done.stderr
    errors = evaluated(folder / "run", rec.with_suffix(".truth"), "--align", "first")
    assert errors["pairs"] > 150 and errors["ape_plane_rmse_m"] < 0.1, errors
    # The scanner's own NMEA sentences tell no height: the places of the fixes do not suffer.
    told = json.loads((folder / "run" / "run.json").read_text())
    assert "gnss_plane_rms_m" in told["quality"], told["quality"]
    # A receiver without heights leaves the height of the layers unknown: they stay local.
    assert not told["georeference"]["on_globe"] and "no heights" in told["georeference"]["reason"]
    fixes = list(csv.DictReader((folder / "run" / "gnss.csv").open()))
    assert len(fixes) > 30 and not any(row["height_m"] for row in fixes), fixes[0]
    assert all(math.hypot(float(row["x"]), float(row["y"])) < 50 for row in fixes), fixes[0]
    page = (folder / "run" / "report.html").read_text()
    assert 'class="fixes"' in page and 'cx="nan"' not in page


def rows_of(path):
    return list(csv.DictReader(gzip.open(path, "rt")))


@cases.case("a walk with an IMU and without")
def with_imu(folder):
    """Quick turns within scans of 128 rings, without a pause between them. The gyroscope knows them, and
    steps from scan to scan guess them. An error of the guess must not grow."""
    errors = []
    walk = simulated("handheld", 5, 9)
    for use in ("false", "true"):
        done = sparse(walk, folder / use, "--set", f"stems.imu.use={use}")
        assert done.returncode == 0, done.stderr
        errors.append(evaluated(folder / use, walk.with_suffix(".truth"), "--align", "se3"))
    plane = [e["ape_plane_rmse_m"] for e in errors]
    turn = [e["ape_rotation_rmse_deg"] for e in errors]
    assert errors[0]["length_m"] > 5 and plane[0] < 0.1, errors[0]
    assert plane[1] < 0.03 and plane[1] < 0.7 * plane[0] and turn[1] < 0.6 * turn[0], (plane, turn)
    return f"{100 * plane[0]:.1f} cm, {turn[0]:.1f} degrees without, {100 * plane[1]:.1f}, {turn[1]:.1f} with"


@cases.case("stems without positions")
def converted(folder):
    out = folder / "seen.csv.gz"
    done = program("convert", REC, out)
    assert done.returncode == 0, done.stderr
    frames = {row["frame"] for row in rows_of(out)}
    assert len(frames) == len(poses(TRUTH / "trajectory.tum")), len(frames)
    # The views of the run are those of its frames, but for the motion within a scan and for stems
    # from 42 m on.
    seen, kept = ([r for r in rows_of(stems) if r["frame"] == "0"
                   and math.hypot(float(r["x"]), float(r["y"])) < 40.0]
                  for stems in (out, RUN / "stems.csv.gz"))
    assert len(kept) > 80 and abs(len(seen) - len(kept)) <= 2, (len(seen), len(kept))


@cases.case("stems of a real map")
def real_map(folder):
    """A scanned pine plot: the same stems as in the list of trees."""
    data = Path(os.environ.get("UNDERSTORY_DATA", Path(__file__).resolve().parents[2] / "../shared/data"))
    cloud = data / "treels" / "pine_plot.laz"
    if not cloud.exists():
        return "skipped: no example data"
    done = program("convert", cloud, folder / "plot.csv.gz")
    assert done.returncode == 0, done.stderr
    done = program("inventory", cloud, "-o", folder / "inventory")
    assert done.returncode == 0, done.stderr
    trees = list(csv.DictReader((folder / "inventory" / "trees.csv").open()))
    stems = rows_of(folder / "plot.csv.gz")
    assert len(stems) == len(trees) > 10, (len(stems), len(trees))
    for tree, stem in zip(trees, stems):
        for column, most in (("x", 0.002), ("y", 0.002), ("z", 0.002), ("dbh_m", 0.001)):
            assert abs(float(tree[column]) - float(stem[column])) < most, (column, tree, stem)
    return f"{len(stems)} stems, those of the list of trees"


@cases.case("what stands on the machine is no stem")
def machine(folder):
    """A box around a stem that is in sight of the standing body: it is no longer seen, those behind
    and beside it are."""
    first = [r for r in rows_of(RUN / "stems.csv.gz") if r["frame"] == "0"]
    post = min(first, key=lambda r: math.hypot(float(r["x"]), float(r["y"])))
    x, y = float(post["x"]), float(post["y"])
    boxes = folder / "boxes.yaml"
    boxes.write_text("boxes:\n  - name: post\n    frame: body\n"
                     f"    center_m: [{x}, {y}, 2]\n    size_m: [1, 1, 8]\n")
    done = sparse("sim:lieksa2?seed=5&duration_s=3", folder / "run", "--profile", "harvester",
                  "--set", f"preprocess.machine_boxes_file={boxes}", "--set", "stems.keep.distance_m=0")
    assert done.returncode == 0, done.stderr
    views = rows_of(folder / "run" / "stems.csv.gz")
    near = [r for r in views if math.hypot(float(r["x"]) - x, float(r["y"]) - y) < 0.5]
    assert views and not near, len(near)
    others = [r for r in views if r["frame"] == "0"]
    assert len(others) > 0.9 * len(first) - 2, (len(others), len(first))
    assert "machine_boxes_file" in (folder / "run" / "run.json").read_text()
    done = sparse(REC, folder / "bad", "--set", f"preprocess.machine_boxes_file={folder / 'none.yaml'}")
    assert done.returncode in (2, 3) and "none.yaml" in done.stderr, (done.returncode, done.stderr)
    assert not (folder / "bad").exists()
    return f"{len(others)} of {len(first)} stems stay"


@cases.case("what cannot be told is not printed as a number")
def untold(folder):
    done = program("evaluate", "trees", RUN, TRUTH, "--align", "yaw")
    assert done.returncode == 0 and "diameter" in done.stdout, done.stderr
    assert "nan" not in done.stdout and "height" not in done.stdout, done.stdout
    done = program("evaluate", "map", RUN, RUN)
    assert done.returncode == 0 and "over all sights" in done.stdout, done
    first = folder / "first.tum"
    first.write_text((RUN / "trajectory.tum").read_text().splitlines()[0] + "\n")
    done = program("evaluate", "map", RUN, first)
    assert done.returncode == 4 and "have no pose" in done.stderr, done
    assert "nan" not in done.stdout and "unknown" in done.stdout, done.stdout


@cases.case("a recording that is cut off")
def cut_off(folder):
    whole = REC.read_bytes()
    (folder / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    done = sparse(folder / "cut.mcap", folder / "run")
    assert done.returncode == 4 and "cut off" in done.stderr, (done.returncode, done.stderr)
    told = json.loads((folder / "run" / "run.json").read_text())
    assert told["status"] == "partial" and told["scans"] > 20, told["status"]


@cases.case("at the speed of the sensor")
def realtime(folder):
    began = time.monotonic()
    done = sparse("sim:lieksa2?seed=5&duration_s=8", folder / "run", "--realtime", "--set",
                  "stems.keep.distance_m=0")
    assert done.returncode == 0, done.stderr
    assert time.monotonic() - began > 7.0
    told = json.loads((folder / "run" / "run.json").read_text())
    assert 7.0 < told["wall_s"] <= time.monotonic() - began, told["wall_s"]
    counts, quality = told["counts"], told["quality"]
    assert counts["scans_positioned"] == told["scans"], counts  # none waits
    assert told["scans"] + counts["scans_dropped"] == len(poses(folder / "run.truth" / "trajectory.tum"))
    assert 0 < quality["latency_ms_mean"] <= quality["latency_ms_p99"] <= quality["latency_ms_max"], quality
    return f"{quality['latency_ms_mean']:.0f} ms from a scan's end to its pose"


@cases.case("wrong use")
def wrong(folder):
    for words in (("--profile", "boat"), ("--set", "stems.reach_m=3"),
                  ("--set", "stems.keep.rule=never"), ("--set", "stems.pace.longest_gap_s=-1"),
                  ("--set", "stems.imu.gravity_sd_deg=0")):
        done = sparse(REC, folder / "run", *words)
        assert done.returncode == 2 and words[0].lstrip('-') in done.stderr, (words, done.stderr)
    done = program("map", "--resume", RUN)
    assert done.returncode == 3 and "nothing to go on with" in done.stderr, done.stderr
    done = sparse(folder / "none.mcap", folder / "run")
    assert done.returncode == 3 and "none.mcap" in done.stderr, done.stderr
    plain = folder / "plain.mcap"
    assert program("convert", REC, plain, "--compression", "none").returncode == 0
    messages = [m for m in read_mcap(plain) if m.topic != "/lidar"]
    write_mcap(folder / "no_lidar.mcap", messages)
    done = sparse(folder / "no_lidar.mcap", folder / "run")
    assert done.returncode == 3 and "no lidar scan" in done.stderr and "/gnss" in done.stderr, done.stderr
    done = program("map", "--front-end", "sparse", "--print-config")
    assert done.returncode == 0 and "distance_m" in done.stdout, done.stderr


@cases.case("scans without rings")
def no_rings(folder):
    clouds = folder / "clouds"
    clouds.mkdir()
    for k in range(3):
        points = array("f")
        for i in range(2000):
            points.extend((5.0 + i % 7, math.sin(0.1 * i + k), 0.01 * (i % 50), 0.5))
        (clouds / f"{k:06}.bin").write_bytes(points.tobytes())
    done = sparse(clouds, folder / "run")
    assert done.returncode == 3 and "ring numbers" in done.stderr, done.stderr
    assert not (folder / "run" / "stems.csv.gz").exists()
    return done.stderr.strip().splitlines()[-1].replace(str(folder), "")


cases.run()
