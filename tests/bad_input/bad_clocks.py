"""Sensors whose clocks run apart, that begin late or die, through `understory map` by both front ends.
Offsets are mended and reported, and a late sensor is used from then on."""

import contextlib
import dataclasses
import json
import math
import signal
import subprocess
import sys
import time

from program import PROGRAM, Cases, Outcome, error_m, good_recording, program
from recordings import edit_imu, write_bag, write_db3, write_indexed_mcap, write_mcap

FRONT_END = sys.argv[1]
SECONDS = 13
cases = Cases()
good, messages, truth = good_recording(
    seconds=SECONDS,
    more=("gnss.enabled=true", "gnss.rate_hz=2", "mag.enabled=true"))
start = next(m for m in messages if m.topic == "/lidar").stamp
OPTIONS = ["--front-end", "sparse"] if FRONT_END == "sparse" else ["--set", "map.enabled=false"]


def second(message):
    return (message.time - start) / 1e9


def mapped(folder, spoilt, *options, write=write_mcap):
    write(folder / "walk.mcap", sorted(spoilt, key=lambda m: m.time))
    return judged(folder / "walk.mcap", folder / "run", *options)


def judged(recording, run, *options):
    """The outcome with its error; by stems in the plane: height is not known well."""
    done = program("map", recording, "-o", run, "--threads", 1, *OPTIONS, *options)
    outcome = Outcome(done.returncode, done.stdout, done.stderr, run)
    assert outcome.code in (0, 4), f"exit {outcome.code}: {outcome.said}"
    if FRONT_END == "dense":
        outcome.error = error_m(outcome, truth)[0]
    else:
        done = program("evaluate", outcome.folder, truth, "--align", "se3", "--json")
        outcome.error = json.loads(done.stdout)["ape_plane_rmse_m"]
    return outcome


def off(topics, seconds):
    """The stamps of these topics moved by that; they arrive as before."""
    return [m.stamped(m.stamp + round(seconds * 1e9)) if m.topic in topics else m for m in messages]


UNDISTURBED = judged(good, cases.folder / "undisturbed")
assert UNDISTURBED.code == 0 and not any(k.startswith("time.") for k in UNDISTURBED.warnings)
BEST = UNDISTURBED.error
WITHOUT_IMU = mapped(cases.folder, [m for m in messages if m.topic != "/imu"]).error


def quality(outcome, name):
    return outcome.run["quality"][name]


def near_undisturbed(outcome, *keys):
    assert outcome.code == 0 or outcome.run["status"] == "partial", outcome.run["reasons"]
    assert outcome.error < 2 * BEST + 0.005, (outcome.error, BEST)
    for key in keys:
        assert key in outcome.warnings, (key, outcome.said)
    return f"{100 * outcome.error:.1f} cm, undisturbed {100 * BEST:.1f} cm"


FIXES, FIELD = ("/gnss", "/gnss/quality"), ("/mag",)
for seconds in (0.5, 5, -0.5, -2) if FRONT_END == "dense" else (2, -5):
    @cases.case(f"fixes {seconds} s ahead and magnetometer as much behind")
    def slow_sensors(folder, seconds=seconds):
        spoilt = [m.stamped(m.stamp - round(seconds * 1e9)) if m.topic in FIELD else m
                  for m in off(FIXES, seconds)]
        outcome = mapped(folder, spoilt)
        if FRONT_END == "dense":
            for name in ("lidar", "imu", "gnss", "mag"):
                received, released = (outcome.run["counts"][f"{name}_{what}"] for what in ("received", "released"))
                assert received == released > 0, (name, received, released)
            assert outcome.run["counts"]["scans_without_imu"] <= 1
            for name, offset in (("gnss", seconds), ("mag", -seconds)):
                mended = quality(outcome, f"{name}_clock_offset_s")
                assert abs(mended + offset) < 0.15 or (offset == -0.5 and mended == 0), (name, mended)
        return near_undisturbed(outcome, "time.clock_offset")

for seconds in (0.5, 2, -5) if FRONT_END == "dense" else (2, -0.5):
    @cases.case(f"IMU {seconds} s ahead")
    def imu_offset(folder, seconds=seconds):
        outcome = mapped(folder, off(("/imu",), seconds))
        assert outcome.code == 0, outcome.run["reasons"]
        if FRONT_END == "dense":
            assert abs(quality(outcome, "imu_clock_offset_s") + seconds) < 0.02
            assert quality(outcome, "imu_unused_s") < 0.5
        said = f"imu: its stamps are {abs(seconds)}"[:-2]
        assert said in outcome.said and "imu.late" not in outcome.warnings, outcome.said
        return near_undisturbed(outcome, "time.clock_offset")


@cases.case("IMU that arrives two seconds late")
def imu_delayed(folder):
    """Its stamps are right: they are shifted by the arrival at first, and the lidar tells better."""
    outcome = mapped(folder, [dataclasses.replace(m, time=m.time + 2_000_000_000)
                              if m.topic == "/imu" else m for m in messages])
    assert outcome.code == 0 or "IMU" in " ".join(outcome.run["reasons"]), outcome.run["reasons"]
    assert outcome.error < max(2 * BEST, 1.5 * WITHOUT_IMU) + 0.005, outcome.error
    return f"exit {outcome.code}, {100 * outcome.error:.1f} cm"


for indexed in (False, True):
    write = write_indexed_mcap if indexed else write_mcap
    container = "file with an index" if indexed else "file without an index"

    @cases.case(f"IMU that begins 4 s late, {container}")
    def imu_late(folder, write=write):
        outcome = mapped(folder, [m for m in messages if m.topic != "/imu" or second(m) > 4], write=write)
        if FRONT_END == "dense":
            assert "imu.late" in outcome.warnings
            assert 3.5 < quality(outcome, "imu_unused_s") < 4.5
            assert quality(outcome, "imu_without_place_s") == 0
        assert "recording.no_imu_extrinsics" not in outcome.warnings
        used_like_undisturbed(outcome)
        return f"{100 * outcome.error:.1f} cm, without IMU {100 * WITHOUT_IMU:.1f} cm"

    @cases.case(f"transforms that come 5 s late, {container}")
    def transforms_late(folder, write=write, indexed=indexed):
        outcome = mapped(folder, [dataclasses.replace(m, time=start + 5_000_000_000)
                                  if m.topic == "/tf_static" else m for m in messages], write=write)
        assert ("recording.late_extrinsics" in outcome.warnings) == (not indexed), outcome.said
        if FRONT_END == "dense":
            unused = quality(outcome, "imu_without_place_s")
            assert unused == 0 if indexed else 4 < unused < 5.5, unused
        used_like_undisturbed(outcome)
        return f"{100 * outcome.error:.1f} cm, without IMU {100 * WITHOUT_IMU:.1f} cm"

    @cases.case(f"first fix after 6 s, {container}")
    def fixes_late(folder, write=write):
        outcome = mapped(folder, [m for m in messages if m.topic not in FIXES or second(m) > 6], write=write)
        fixes = sum(1 for _ in open(outcome.folder / "gnss.csv")) - 1
        assert fixes > 0.9 * 2 * (SECONDS - 6), fixes
        return near_undisturbed(outcome)


def write_indexed_bag(path, spoilt):
    write_bag(path, [m for m in spoilt if m.topic in ("/lidar", "/imu", "/tf_static")], indexed=True)


for kind, write in (("ROS 1 bag", write_indexed_bag), ("ROS 2 bag", write_db3)) if FRONT_END == "dense" else ():
    @cases.case(f"IMU that begins 4 s late, transforms after 5 s, {kind}")
    def late_in_bag(folder, write=write):
        outcome = mapped(folder, [dataclasses.replace(m, time=start + 5_000_000_000)
                                  if m.topic == "/tf_static" else m
                                  for m in messages if m.topic != "/imu" or second(m) > 4], write=write)
        assert "recording.late_extrinsics" not in outcome.warnings
        assert "recording.no_imu_extrinsics" not in outcome.warnings
        assert quality(outcome, "imu_without_place_s") == 0
        used_like_undisturbed(outcome)
        return f"{100 * outcome.error:.1f} cm"


@cases.case("killed, and resumed: clocks that run apart, transforms that come late")
def resumed(folder):
    spoilt = [dataclasses.replace(m, time=start + 5_000_000_000) if m.topic == "/tf_static" else m
              for m in off(("/imu",), -2)]
    spoilt = [m.stamped(m.stamp + 2_000_000_000) if m.topic in FIXES else m for m in spoilt]
    whole = mapped(folder, spoilt)
    settings = ["--quiet", "--threads", "1", *OPTIONS, "--set", "run.checkpoint_interval_s=1"]
    killed = folder / "killed"
    command = [PROGRAM, "map", folder / "walk.mcap", "-o", killed, *settings]
    run = subprocess.Popen(list(map(str, command)), stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    written = set()
    enough = 8 if FRONT_END == "dense" else 4  # some seconds are behind it; by stems gaps come in between
    while run.poll() is None and len(written) < enough:
        with contextlib.suppress(FileNotFoundError):
            written.update(f.stat().st_mtime_ns for f in (killed / ".understory").glob("checkpoint*"))
        time.sleep(0.002)
    run.kill()
    assert run.wait() == -signal.SIGKILL, "the run had ended before it could be killed"
    done = program("map", "--resume", killed)
    assert done.returncode in (0, 4), done.stderr
    for name in ("trajectory.tum", "gnss.csv"):
        assert (killed / name).read_bytes() == (whole.folder / name).read_bytes(), name
    return f"the same bytes, exit {done.returncode}"


def used_like_undisturbed(outcome):
    """What the IMU alone can tell, biases and up, is there in the end; the error is not that without."""
    assert outcome.error < max(2 * BEST, WITHOUT_IMU) + 0.005, (outcome.error, BEST, WITHOUT_IMU)
    if FRONT_END == "sparse":
        return
    import gzip
    last = gzip.open(outcome.folder / "states.csv.gz", "rt").read().splitlines()[-1].split(",")
    assert any(abs(float(v)) > 1e-6 for v in last[4:10]), f"no biases of the IMU: {last[:10]}"


def lidar_at(stamp_of):
    """The recording with other stamps of its scans; they arrive as before."""
    return [m.stamped(round(stamp_of(m))) if m.topic == "/lidar" else m for m in messages]


for name, stamp_of in (("stands still after 8 s", lambda m: min(m.stamp, start + 8e9)),
                       ("says 0", lambda m: 0),
                       ("runs backwards", lambda m: 2 * start + SECONDS * 1e9 - m.stamp)):
    @cases.case(f"a lidar whose clock {name}")
    def lidar_clock(folder, stamp_of=stamp_of):
        path = folder / "walk.mcap"
        write_mcap(path, sorted(lidar_at(stamp_of), key=lambda m: m.time))
        done = program("map", path, "-o", folder / "run", "--threads", 1, *OPTIONS)
        outcome = Outcome(done.returncode, done.stdout, done.stderr, folder / "run")
        if outcome.code == 3:  # by stems: too few views for a map
            assert "clock" in outcome.said, outcome.said
            return outcome.said.strip().splitlines()[-1]
        assert outcome.run["status"] != "complete"
        reasons = "; ".join(outcome.run["reasons"])
        assert "with the stamp of another scan (the clock of the lidar" in reasons, reasons
        return reasons


@cases.case("scans recorded twice")
def recorded_twice(folder):
    twice = [copy for m in messages for copy in ((m, m) if m.topic == "/lidar" else (m,))]
    outcome = mapped(folder, twice)
    assert outcome.run["evidence"]["lidar_duplicates"] > 100
    assert outcome.run["evidence"]["lidar_stamp_taken"] == 0
    return near_undisturbed(outcome)


@cases.case("a lidar that stops 4 s before the IMU and the receiver")
def lidar_stops(folder):
    outcome = mapped(folder, [m for m in messages if m.topic != "/lidar" or second(m) < SECONDS - 3.95])
    reasons = "; ".join(outcome.run["reasons"])
    assert outcome.code == 4 and outcome.run["status"] == "partial", reasons
    assert "the lidar stopped 4.0 s before the " in reasons, reasons
    return reasons


if FRONT_END == "dense":
    @cases.case("an IMU of ten samples a second")
    def slow_imu(folder):
        """Too few to integrate: the run does without, and says so."""
        kept, last = [], 0
        for m in messages:
            if m.topic == "/imu" and m.stamp - last < 99e6:
                continue
            last = m.stamp if m.topic == "/imu" else last
            kept.append(m)
        outcome = mapped(folder, kept)
        reasons = "; ".join(outcome.run["reasons"])
        assert outcome.code == 4 and "the IMU was not used for" in reasons, reasons
        assert "too far apart" in reasons, reasons
        return reasons


@cases.case("an IMU of NaN")
def imu_of_nan(folder):
    """As without an IMU, and said."""
    nothing = [math.nan] * 3
    outcome = mapped(folder, [edit_imu(m, lambda rate, force: (nothing, nothing)) if m.topic == "/imu" else m
                              for m in messages])
    if FRONT_END == "dense":
        # With a place that no sample fills, the error was 1.4 times as large.
        assert outcome.error < 1.1 * WITHOUT_IMU, (outcome.error, WITHOUT_IMU)
        assert "no sample of the IMU can be used" in outcome.said, outcome.said
    assert outcome.error < 1.5 * WITHOUT_IMU + 0.005, (outcome.error, WITHOUT_IMU)
    reasons = "; ".join(outcome.run["reasons"])
    assert "messages of the IMU (100.0 %) were not used" in reasons, reasons
    return reasons


@cases.case("IMU that dies, and a lidar with gaps")
def imu_dies(folder):
    def heard(message):
        if message.topic == "/imu":
            return second(message) < 4
        return message.topic != "/lidar" or second(message) < 6 or second(message) % 3 > 0.6
    outcome = mapped(folder, [m for m in messages if heard(m)])
    if FRONT_END == "dense":
        assert outcome.run["counts"]["lidar_gaps"] >= 3 and outcome.run["counts"]["lidar_clock_jumps"] == 0
        assert quality(outcome, "imu_unused_s") > SECONDS - 6
        assert quality(outcome, "lidar_unused_s") > 1
        assert "imu.stopped" in outcome.warnings
    assert outcome.error < 3 * max(BEST, WITHOUT_IMU) + 0.02, outcome.error
    return f"exit {outcome.code}, {100 * outcome.error:.1f} cm"


@cases.case("at the speed of the sensors, clocks of different epochs")
def realtime(folder):
    spoilt = [m.stamped(m.stamp - start + 5_000_000_000) if m.topic == "/imu" else m
              for m in off(FIXES, 2) if second(m) < 8]
    began = time.monotonic()
    outcome = mapped(folder, spoilt, "--realtime")
    assert 7 < time.monotonic() - began < 60
    if FRONT_END == "dense":
        assert abs(quality(outcome, "imu_clock_offset_s") - (start - 5e9) / 1e9) < 0.02
        assert outcome.run["counts"]["imu_too_late"] == 0
    assert "time.clock_offset" in outcome.warnings
    return f"exit {outcome.code}, {100 * outcome.error:.1f} cm; {outcome.run['reasons']}"


@cases.case("Ctrl-C at the speed of the sensors, within a gap")
def interrupted(folder):
    write_mcap(folder / "walk.mcap", [m for m in messages if not 4 < second(m) < 12])
    command = [PROGRAM, "--quiet", "map", folder / "walk.mcap", "-o", folder / "run", "--realtime", *OPTIONS]
    run = subprocess.Popen(list(map(str, command)), stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    time.sleep(7)
    run.send_signal(signal.SIGINT)
    code = run.wait(200)
    outcome = Outcome(code, "", run.stderr.read().decode(), folder / "run")
    assert code == 4 and outcome.run["status"] == "partial", outcome.said
    last = float(outcome.poses[-1].split()[0]) - start / 1e9
    assert last < 4.2, f"went on to {last:.1f} s"
    return f"ended at {last:.1f} s"


cases.run()
