"""`./run accuracy --spoilt`: recordings spoilt so that the map is wrong, beside good ones.

  ./run accuracy --spoilt                       100 wrong and 100 good ones, seeds 41 on
  ./run accuracy --spoilt --seeds 1 2           seeds to tune on (1 to 19)
  ./run accuracy --spoilt --way ranges          only ways with this in their names
  ./run accuracy --spoilt --keep DIR            results.jsonl stays there; run again, it goes on where it was
  ./run accuracy --spoilt --keep DIR --fit      from the results there: what each number of the evidence is
                                                in good and in wrong runs, beside the limits
  ./run accuracy --spoilt --write               puts the table into docs/method/results.md

Wrong: the error of the positions is over 10 times that of the undisturbed recording and over 20 cm. It
is the RMS after the best rigid motion, with scans taken at their true times. A spoilt recording that
stays below does not count; it is listed as not spoilt enough, and the next one takes its place. Nor does
a run that ends without a result (exit 3): there is no map that could deceive. Ways that never made a
wrong map of seeds 1 and 2 are left out (`withstood` in spoil.py). The program found them out there and
did without the IMU.

Good: a recording as it is whose map is not wrong by the same measure. One without its IMU is compared with
the same recording with its IMU. Any other has nothing to be compared with: its error is 20 cm at most. A
recording as it is whose map is wrong was lost without being spoilt: it counts as a map that must not
be called complete. The table also tells how many of all recordings as they are were called untrusted, lost
ones included.

Floors: no wrong map is called complete, no good one untrusted, and in nine of ten wrong ones a reason
names the cause.
"""

import json
import random
import re
import shutil
import time

import numpy as np

from program import TOP, PROGRAM, machine, run, say, version
from spoil import APART, WAYS, read_mcap, whole, without_imu, write_folder, write_mcap

DURATION_S = 60
WRONG_TIMES, WRONG_M = 10.0, 0.20
REPORTED_SEEDS = range(41, 61)
# Carriers of all kinds that move within a minute, with scanners small enough to be spoilt by a script.
SPOILT_SITES = {
    "handheld": ["lidar.model=VLP-16"],
    "evo1": ["lidar.model=VLP-16"],
    "lohja1": [],
    "lake": [],
    "demo": ["lidar.model=VLP-16"],
    "forest": [],
    "lohja2": [],
    "skidoo": [],
    "evo2": ["lidar.model=VLP-16"],
    "evo3": ["lidar.model=VLP-16"],
}
GOOD_SITES = ["handheld", "harvester", "evo1", "evo2", "evo3", "tuusniemi1", "tuusniemi3", "lieksa1",
              "lieksa2", "lieksa3", "lohja1", "lohja2", "lake", "forest", "skidoo", "demo"]
BEGIN, END = "<!-- spoilt table: ./run accuracy --spoilt --write -->", "<!-- end of spoilt table -->"
RESULTS = TOP / "docs" / "method" / "results.md"


# --- One recording -------------------------------------------------------------------------------


def read_tum(path):
    rows = np.loadtxt(path, ndmin=2) if path.exists() and path.stat().st_size else np.zeros((0, 8))
    stamps = [line.split()[0] for line in path.read_text().splitlines()] if len(rows) else []
    ns = [int(s.split(".")[0]) * 10**9 + int((s.split(".") + ["0"])[1].ljust(9, "0")[:9])
          for s in stamps]
    return np.array(ns, dtype=np.int64), rows[:, 1:4]


def rigid_error(ours, truth):
    """RMS distance after the best rotation and shift (Umeyama without scale)."""
    a, b = ours - ours.mean(axis=0), truth - truth.mean(axis=0)
    u, _, vt = np.linalg.svd(b.T @ a)
    sign = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    return float(np.sqrt(np.mean(np.sum((a @ (u @ sign @ vt).T - b) ** 2, axis=1))))


def error_m(folder, truth, true_time):
    """(error, pairs): the run's positions against the truth at the times when they were really taken."""
    stamps, ours = read_tum(folder / "trajectory.tum")
    known = np.array(sorted(s for s, t in true_time.items() if t is not None), dtype=np.int64)
    if len(stamps) < 10 or len(known) == 0:
        return None, 0
    at = np.clip(np.searchsorted(known, stamps), 1, len(known) - 1)
    nearest = np.where(stamps - known[at - 1] < known[at] - stamps, at - 1, at)
    good = np.abs(known[nearest] - stamps) < 2_000_000
    if good.sum() < 10:
        return None, 0
    real = np.array([true_time[int(s)] for s in known[nearest[good]]], dtype=np.int64)
    when, where = truth
    began = when[0]
    path = np.stack([np.interp((real - began) * 1e-9, (when - began) * 1e-9, where[:, i])
                     for i in range(3)], axis=1)
    return rigid_error(ours[good], path), int(good.sum())


class Work:
    """A folder for recordings and runs, and results.jsonl."""

    def __init__(self, folder):
        self.folder = folder
        self.file = folder / "results.jsonl"
        self.rows = {}
        if self.file.exists():
            for line in self.file.read_text().splitlines():
                row = json.loads(line)
                self.rows[row["key"]] = row
        self.walks = {}

    def put(self, row):
        self.rows[row["key"]] = row
        with open(self.file, "a") as file:
            file.write(json.dumps(row) + "\n")
        said = "; ".join(row["reasons"])[:110]
        error = "" if row["error_m"] is None else f"{row['error_m']:8.3f} m"
        say(f"  {row['key']:70} {row['status']:9} {error} {said}")

    def walk(self, site, seed, settings):
        """(messages as a Walk, truth) of a recording, simulated once; only the last ones are held."""
        key = f"{site}_{seed}"
        if key not in self.walks:
            while len(self.walks) > 1:
                self.walks.pop(next(iter(self.walks)))
            packed, plain = self.folder / f"{key}.mcap", self.folder / f"{key}.plain.mcap"
            if not packed.exists():
                words = [w for s in settings + ["gnss.enabled=false"] for w in ("--set", s)]
                done = run(PROGRAM, "--quiet", "simulate", site, "-o", packed, "--seed",
                           seed, "--duration-s", DURATION_S, *words)
                assert done.code == 0, done.stderr
            run(PROGRAM, "--quiet", "convert", packed, plain, "--compression", "none")
            walk = whole(read_mcap(plain))
            plain.unlink()
            self.walks[key] = walk, read_tum(self.folder / f"{key}.truth" / "trajectory.tum")
        return self.walks[key]


def map_walk(work, key, walk, options=()):
    """(run.json or None, exit code, what was said, folder of the run)."""
    place = work.folder / "spoilt"
    shutil.rmtree(place, ignore_errors=True)
    if walk.folder:
        source = place
        write_folder(source, walk)
    else:
        place.mkdir()
        source = place / "walk.mcap"
        write_mcap(source, walk.messages)
    return map_source(work, key, source, options)


def map_source(work, key, source, options=()):
    folder = work.folder / "run"
    shutil.rmtree(folder, ignore_errors=True)
    more = [] if "sparse" in options else ["--set", "map.enabled=false"]
    done = run(PROGRAM, "--quiet", "map", source, "-o", folder, "--threads", 1,
               *more, *options)
    report = folder / "run.json"
    return (json.loads(report.read_text()) if report.exists() else None, done.code, done.stderr,
            folder, done.cpu_s)


def row_of(key, result, error, pairs, **more):
    report, code, said, folder, cpu_s = result
    row = {"key": key, "code": code, "cpu_s": cpu_s, "error_m": error, "pairs": pairs,
           "status": report["status"] if report else ("none" if code == 3 else f"exit {code}"),
           "reasons": [reason.replace(f"{folder.parent}/", "").replace("spoilt/", "")
                       for reason in (report["reasons"] if report else [said.strip()[-300:]])],
           "evidence": report.get("evidence", {}) if report else {},
           "warnings": [w["key"] for w in report["warnings"]] if report else []}
    row.update(more)
    return row


# --- Plan ----------------------------------------------------------------------------------------


def imu_kinds(way):
    return {"with": [True], "without": [False], "both": [True, False]}[way.imu]


def ways_and_imu(name):
    """(way, with its IMU) of those in the plan with `name` in their names."""
    return [(way, imu) for way in WAYS if not way.withstood and name in way.name
            for imu in imu_kinds(way)]


def spoilt_plan(seeds, name=""):
    """(site, seed, way, imu) one after another: ways go through sites and seeds in turn."""
    places = [(site, seed) for seed in seeds for site in SPOILT_SITES]
    cases = ways_and_imu(name)
    for lap in range(len(places)):
        yield from ((*places[(lap + 3 * i) % len(places)], way, imu)
                    for i, (way, imu) in enumerate(cases))


def by_place(plan, lap):
    """One lap of the plan, those of one recording together; a wrong IMU, which is often found, last."""
    return sorted(plan[:lap], key=lambda case: (case[2].of_imu_alone, case[1], case[0]))


def is_wrong(error, reference):
    """Of a map with that error against the one with the reference's; None: there is none."""
    return error is not None and error > WRONG_M and \
        (reference is None or error > WRONG_TIMES * reference)


def base_key(site, seed, imu):
    return f"{site} {seed} {'' if imu else 'without IMU '}as it is"


def undisturbed(work, site, seed, imu):
    key = base_key(site, seed, imu)
    if key not in work.rows:
        walk, truth = work.walk(site, seed, SPOILT_SITES[site])
        if not imu:
            walk = without_imu(walk)
        result = map_walk(work, key, walk)
        work.put(row_of(key, result, *error_m(result[3], truth, walk.true_time), kind="base",
                        site=site, seed=seed, imu=imu))
    error = work.rows[key]["error_m"]
    if not imu and error is not None and error > WRONG_M:
        undisturbed(work, site, seed, True)  # what it is compared with
    return work.rows[key]


def measure_spoilt(work, site, seed, way, imu):
    key = f"{site} {seed} {'' if imu else 'without IMU '}{way.name}"
    if key in work.rows:
        return work.rows[key]
    base = undisturbed(work, site, seed, imu)
    walk, truth = work.walk(site, seed, SPOILT_SITES[site])
    if not imu:
        walk = without_imu(walk)
    draw = random.Random(key)
    extra = ()
    if getattr(way.spoil, "needs_other", False):
        sites = list(SPOILT_SITES)
        other = sites[(sites.index(site) + 1) % len(sites)]
        extra = (work.walk(other, seed, SPOILT_SITES[other])[0],)
    spoilt = way.spoil(walk, draw, *extra)
    result = map_walk(work, key, spoilt, spoilt.options)
    error, pairs = error_m(result[3], truth, spoilt.true_time)
    wrong = base["error_m"] is not None and is_wrong(error, base["error_m"])
    named = is_named(way, result)
    row = row_of(key, result, error, pairs, kind="spoilt", site=site, seed=seed, imu=imu,
                 way=way.name, base_m=base["error_m"], wrong=wrong, named=named)
    work.put(row)
    return row


def is_named(way, result):
    report = result[0]
    reasons = report["reasons"] if report else ["no result: " + result[2]]
    return any(re.search(way.cause, reason) for reason in reasons)


def good_plan(seeds):
    """(site, seed, options of map, settings of the site)."""
    for seed in seeds:
        for site in GOOD_SITES:
            yield site, seed, ["--front-end", "sparse"] if site.startswith("lieksa") else [], []


def measure_good(work, site, seed, options, settings):
    key = f"good {site} {seed}"
    if key in work.rows:
        return work.rows[key]
    uri = f"sim:{site}?" + "&".join([f"seed={seed}", f"duration_s={DURATION_S}", *settings])
    result = map_source(work, key, uri, options)
    truth = read_tum(work.folder / "run.truth" / "trajectory.tum")
    stamps, _ = read_tum(result[3] / "trajectory.tum")
    error, pairs = error_m(result[3], truth, {int(s): int(s) for s in stamps})
    work.put(row_of(key, result, error, pairs, kind="good", site=site, seed=seed))
    return work.rows[key]


def real_sources():
    """(name, recording, options) of the real recordings beside the source tree."""
    import os
    from pathlib import Path
    data = Path(os.environ.get("UNDERSTORY_DATA", TOP.parent / "shared" / "data"))
    names = [("KITTI 00, four clouds", "kitti00_0-3"),
             ("OS-1-128, capture", "drivers/OS-1-128_v2.3.0_1024x10_lb_n3.pcap"),
             ("VLP-16, capture", "drivers/sample_velodyne_vlp16_gps.pcap"),
             ("VLP-16, bag of packets", "drivers/nebula_vlp16/1673400471837873222"),
             ("Newer College, six clouds", "newer_college_6")]
    return [(name, data / path) for name, path in names if (data / path).exists()]


def measure_real(work):
    """Of the six clouds of the Newer College, 5.6 s apart, truth is known: they are no good run."""
    for name, source in real_sources():
        key = f"real {name}"
        if key in work.rows:
            continue
        result = map_source(work, key, source)
        truth = source / "ground_truth.csv"
        if not truth.exists():
            work.put(row_of(key, result, None, 0, kind="good", site=name, seed=0))
            continue
        error, pairs = error_of_clouds(result[3], truth)
        work.put(row_of(key, result, error, pairs, kind="spoilt", site=name, seed=0, imu=False,
                        way=APART.name, wrong=error > WRONG_M, named=is_named(APART, result)))


def error_of_clouds(folder, truth):
    """(error, pairs) against a row per cloud: seconds, nanoseconds, x, y, z and more."""
    _, ours = read_tum(folder / "trajectory.tum")
    true = np.loadtxt(truth, delimiter=",", skiprows=1)[:, 2:5]
    return rigid_error(ours, true), len(true)


# --- Tables --------------------------------------------------------------------------------------


def split(rows):
    """(wrong, not spoilt enough, without result, good, lost) rows; lost: wrong as it is."""
    spoilt = [r for r in rows if r["kind"] == "spoilt"]
    none = [r for r in spoilt if r["status"] == "none"]
    wrong = [r for r in spoilt if r["wrong"]]
    mild = [r for r in spoilt if not r["wrong"] and r["status"] != "none"]
    errors = {r["key"]: r["error_m"] for r in rows}

    def was_lost(row):
        compared = row["kind"] == "base" and not row["imu"]
        reference = errors.get(base_key(row["site"], row["seed"], True)) if compared else None
        return is_wrong(row["error_m"], reference)

    as_is = [r for r in rows if r["kind"] in ("good", "base")]
    lost = [r for r in as_is if was_lost(r)]
    return wrong, mild, none, [r for r in as_is if r not in lost], lost


def of_status(status, rows):
    return [r for r in rows if r["status"] == status]


def render(rows, seconds):
    wrong, mild, none, good, lost = split(rows)
    deceived, deceived_as_is = (of_status("complete", group) for group in (wrong, lost))
    half = of_status("partial", wrong + lost)
    named = [r for r in wrong if r["named"]]
    refused, partial = (of_status(status, good) for status in ("untrusted", "partial"))
    left_out = [way.name for way in WAYS if way.withstood]
    seeds = sorted({r["seed"] for r in rows if r["seed"]})
    text = [f"{version()}, {time.strftime('%Y-%m-%d')}, {machine()}; seeds "
            f"{', '.join(map(str, seeds))}; {DURATION_S} s each; {seconds / 60:.0f} minutes.", "",
            "| | runs | |", "|---|---|---|",
            f"| wrong maps | {len(wrong)} | of {len(wrong) + len(mild) + len(none)} spoilt ones: "
            f"{len(mild)} not spoilt enough, {len(none)} without a result |",
            f"| wrong maps called complete | {len(deceived)} | floor 0 |",
            f"| wrong maps with a reason that names the cause | {len(named)} | "
            f"{100 * len(named) / max(1, len(wrong)):.0f} %, floor 90 % |",
            f"| wrong maps called partial | {len(half)} | |",
            f"| recordings as they are | {len(good) + len(lost)} | with and without their IMU |",
            f"| of these lost without being spoilt: the map is wrong | {len(lost)} | "
            f"called complete: {len(deceived_as_is)}, floor 0 |",
            f"| good ones: as they are, the map is not wrong | {len(good)} | |",
            f"| good ones called untrusted | {len(refused)} | floor 0 |",
            f"| recordings as they are called untrusted | {len(refused + of_status('untrusted', lost))} | "
            "lost ones included |",
            f"| good ones called partial | {len(partial)} | |", "",
            f"{len(WAYS) - len(left_out)} of {len(WAYS)} ways are in the plan. The others are left out, because they made "
            "no wrong map of seeds 1 and 2:", *(f"- {name}" for name in left_out), "",
            "| spoilt by | wrong | complete | cause named | not spoilt enough | error of the wrong ones m |",
            "|---|---|---|---|---|---|"]
    for way in WAYS + [APART]:
        mine = [[r for r in group if r.get("way") == way.name]
                for group in (wrong, deceived, named, mild)]
        errors = sorted(r["error_m"] for r in mine[0])
        if not any(r.get("way") == way.name for r in rows):
            continue
        spread = f"{errors[0]:.1f} to {errors[-1]:.1f}" if errors else ""
        text.append(f"| {way.name} | {len(mine[0])} | {len(mine[1])} | {len(mine[2])} | "
                    f"{len(mine[3])} | {spread} |")
    for title, group in (("wrong and called complete", deceived + deceived_as_is),
                         ("wrong and called partial", half),
                         ("wrong and the cause is not named", [r for r in wrong if not r["named"]]),
                         ("not spoilt enough, called complete, and off by over 20 cm",
                          [r for r in of_status("complete", mild) if r["error_m"] > WRONG_M]),
                         ("lost without being spoilt", lost),
                         ("good and called untrusted", refused),
                         ("good and called partial", partial)):
        text += [""] * bool(group)
        for r in group:  # a reason a line, so that each can be read
            text += [f"- {title}: {r['key']}", *(f"  - {reason}" for reason in r["reasons"])]
    return ("\n".join(text) + "\n", deceived + deceived_as_is, refused,
            len(named) / max(1, len(wrong)))


def fit(rows):
    """For each number of the evidence: where good and wrong runs lie."""
    wrong, _, _, good, _ = split(rows)
    names = sorted({n for r in rows for n, v in r["evidence"].items() if isinstance(v, (int, float))})
    text = ["| evidence | good: median | 99 % | largest | wrong: 10 % | median | 90 % |",
            "|---|---|---|---|---|---|---|"]
    for name in names:
        a, b = (np.array([float(r["evidence"][name]) for r in group
                          if r["evidence"].get(name) is not None]) for group in (good, wrong))
        if len(a) and len(b):
            cells = [np.median(a), np.percentile(a, 99), a.max(), *np.percentile(b, [10, 50, 90])]
            text.append(f"| {name} | " + " | ".join(f"{c:.4g}" for c in cells) + " |")
    return "\n".join(text) + "\n"


def write_results(text):
    head, rest = RESULTS.read_text().split(BEGIN, 1)
    _, tail = rest.split(END, 1)
    RESULTS.write_text(f"{head}{BEGIN}\n{text}{END}{tail}")


def measure_spoilt_runs(folder, seeds, wanted, write, only_fit, way=""):
    """True if the floors are met."""
    begin = time.perf_counter()
    work = Work(folder)
    seeds = seeds or REPORTED_SEEDS
    if only_fit:
        print(fit(list(work.rows.values())))
        return True
    plan = list(spoilt_plan(seeds, way))
    lap = len(ways_and_imu(way))
    measure_real(work)
    goods, wrong = good_plan(seeds), 0
    for at in range(0, len(plan), lap):
        for case in by_place(plan[at:at + lap], lap):
            if wrong >= wanted:
                break
            wrong += measure_spoilt(work, *case)["wrong"]
    while not way and sum(r["kind"] in ("good", "base") for r in work.rows.values()) < wanted:
        good = next(goods, None)
        if good is None:
            break
        measure_good(work, *good)
    text, deceived, refused, named = render(list(work.rows.values()), time.perf_counter() - begin)
    print(text)
    if write:
        write_results(text)
    return not deceived and not refused and named >= 0.9
