"""Recordings in which a sensor fails, through `understory map`: the estimator copes or says why not."""

import dataclasses
import gzip
import json
import math
import random
import struct

from program import Cases, error_m, good_recording, map_recording, program
from recordings import Cloud, edit_cloud, edit_imu, write_mcap

cases = Cases()
good, messages, truth = good_recording(seconds=24)
scans = [m for m in messages if m.topic == "/lidar"]
start = scans[0].stamp
short = [m for m in messages if m.time < start + 12e9]
ALL = sum(m.topic == "/lidar" for m in short)
# Where the IMU is given up, all is mapped twice, and slowly.
brief = [m for m in messages if m.time < start + 8e9]
BRIEF = sum(m.topic == "/lidar" for m in brief)


def with_imu(change, of=brief):
    return [edit_imu(m, change) if m.topic == "/imu" else m for m in of]


def with_clouds(change):
    return [edit_cloud(m, change) if m.topic == "/lidar" else m for m in short]


def mapped(folder, spoilt, *options):
    path = folder / "walk.mcap"
    write_mcap(path, spoilt)
    return path, map_recording(path, folder / "run", *options)


def expect(outcome, code, error_below, *said, pairs=ALL):
    assert outcome.code == code, f"exit {outcome.code}: {outcome.said}"
    for words in said:
        assert words in outcome.said, f"expected '{words}' in: {outcome.said}"
    error, found = error_m(outcome, truth)
    assert abs(found - pairs) <= 2 and error < error_below, (found, error)
    text = outcome.run["reasons"] or [w["message"] for w in outcome.run["warnings"]]
    return f"exit {code}, {100 * error:.1f} cm; {(text + [''])[0]}".replace(str(outcome.folder), "")


def expect_partial(outcome, *said):
    """Whoever reads only status and reasons knows what was not used."""
    assert outcome.run["status"] == "partial", outcome.run["reasons"]
    for words in said:
        assert words in "; ".join(outcome.run["reasons"]), outcome.run["reasons"]


@cases.case("no lidar")
def no_lidar(folder):
    path, outcome = mapped(folder, [m for m in short if m.topic != "/lidar"])
    assert outcome.code == 3 and f"{path}: no lidar scan" in outcome.said, outcome.said
    assert "/imu" in outcome.said
    return outcome.said.strip().replace(str(folder), "")


@cases.case("a lidar that is covered at first")
def covered(folder):
    """Nothing is adapted to a lidar of which nothing is known, and that is said."""
    def blind(cloud):
        cloud.points = bytearray()
    spoilt = [edit_cloud(m, blind) if m.topic == "/lidar" and m.stamp < start + 10.5e9 else m for m in messages]
    _, outcome = mapped(folder, spoilt)
    assert outcome.code == 4 and "lidar.unknown" in outcome.warnings, (outcome.code, outcome.said)
    assert not any("sparse" in change["why"] for change in outcome.run["adapted"]), outcome.run["adapted"]
    assert outcome.run["evidence"]["scans_repeated"] == 0, outcome.run["evidence"]
    message = outcome.warnings["lidar.unknown"]["message"]
    assert "no setting was adapted" in message, message
    (folder / "seen").mkdir()
    _, outcome = mapped(folder / "seen", short)
    assert "lidar.unknown" not in outcome.warnings, outcome.warnings
    assert any("sparse" in change["why"] for change in outcome.run["adapted"]), outcome.run["adapted"]
    return message.replace(str(folder), "")


@cases.case("no IMU")
def no_imu(folder):
    path, outcome = mapped(folder, [m for m in short if m.topic != "/imu"])
    assert "imu.none" in outcome.warnings
    return expect(outcome, 0, 0.1, f"{path}: no IMU")


@cases.case("IMU that stops")
def imu_stops(folder):
    path, outcome = mapped(folder, [m for m in short if m.topic != "/imu" or m.stamp < start + 6e9])
    assert "imu.stopped" in outcome.warnings
    expect_partial(outcome, "the IMU was not used for", "it stops 6.")
    return expect(outcome, 4, 0.06, f"{path}: the IMU stopped at {(start + 6e9) / 1e9:.0f}"[:-1])


@cases.case("IMU that begins late")
def imu_late(folder):
    path, outcome = mapped(folder, [m for m in short if m.topic != "/imu" or m.stamp > start + 4e9])
    assert outcome.run["quality"]["imu_without_place_s"] == 0
    assert 3.5 < outcome.run["quality"]["imu_unused_s"] < 4.5  # and then it is used: biases
    last = gzip.open(outcome.folder / "states.csv.gz", "rt").read().splitlines()[-1].split(",")
    assert any(abs(float(v)) > 1e-6 for v in last[4:10]), last
    expect_partial(outcome, "the IMU was not used for", "it begins 4.0 s after the lidar")
    return expect(outcome, 4, 0.1, f"{path}: the IMU begins 4.0 s after the lidar")


@cases.case("IMU that begins half a second late")
def imu_hardly_late(folder):
    path, outcome = mapped(folder, [m for m in short if m.topic != "/imu" or m.stamp > start + 5e8])
    assert outcome.run["status"] == "complete", outcome.run["reasons"]
    return expect(outcome, 0, 0.1)


@cases.case("IMU with a hole of three seconds")
def imu_hole(folder):
    _, outcome = mapped(folder, [m for m in short if m.topic != "/imu" or
                                 not start + 4e9 < m.stamp < start + 7e9])
    expect_partial(outcome, "the IMU was not used for", "it was silent for 3.0 s")
    return expect(outcome, 4, 0.06, "imu: nothing for 3.0")


AXES = {
    "x and y of the IMU swapped": (lambda v: (v[1], v[0], v[2]), "x=+y y=+x z=+z"),
    "axes of the IMU cycled": (lambda v: (v[2], v[0], v[1]), "x=+y y=+z z=+x"),
    "IMU turned by 90 degrees": (lambda v: (-v[1], v[0], v[2]), "x=+y y=-x z=+z"),
}
for name, (turn, axes) in AXES.items():
    @cases.case(name)
    def turned(folder, turn=turn, axes=axes):
        _, outcome = mapped(folder, with_imu(lambda rates, forces: (turn(rates), turn(forces))))
        assert "imu.untrusted" in outcome.warnings
        return expect(outcome, 4, 0.1, f"to agree with the lidar they would be {axes}",
                      "mapped without the IMU", pairs=BRIEF)


@cases.case("wrong signs of the gyroscope")
def gyro_signs(folder):
    _, outcome = mapped(folder, with_imu(lambda rates, forces: ([-r for r in rates], forces)))
    return expect(outcome, 4, 0.1, "x=-x y=-y z=-z", "mapped without the IMU", pairs=BRIEF)


@cases.case("accelerometer without gravity")
def no_gravity(folder):
    _, outcome = mapped(folder, with_imu(lambda rates, f: (rates, (f[0], f[1], f[2] - 9.81))))
    return expect(outcome, 4, 0.1, "mean specific force", "mapped without the IMU", pairs=BRIEF)


@cases.case("gyroscope in degrees")
def degrees(folder):
    _, outcome = mapped(folder, with_imu(lambda r, f: ([math.degrees(v) for v in r], f)))
    return expect(outcome, 4, 0.1, "Its rates look like degrees per second",
                  "mapped without the IMU", pairs=BRIEF)


@cases.case("accelerometer in g")
def in_g(folder):
    _, outcome = mapped(folder, with_imu(lambda rates, f: (rates, [v / 9.80665 for v in f])))
    return expect(outcome, 0, 0.03, "accelerations are in g", pairs=BRIEF)


@cases.case("IMU clock 0.2 s off")
def imu_clock(folder):
    _, outcome = mapped(folder, [m.at(m.stamp + 200_000_000) if m.topic == "/imu" else m
                                 for m in short])
    return expect(outcome, 4, 0.1, "gyroscope and lidar disagree", "clock")


@cases.case("wrong extrinsics")
def wrong_extrinsics(folder):
    path = folder / "extrinsics.yaml"
    path.write_text("body_frame: imu\n"
                    "body_from_lidar: {translation_m: [0, 0, 0.06], rpy_deg: [0, 25, 0]}\n"
                    "body_from_imu: {translation_m: [0, 0, 0], rpy_deg: [0, 0, 0]}\n")
    _, outcome = mapped(folder, short, "--extrinsics", path)
    assert outcome.code == 4 and "looks mounted about 2" in outcome.said, outcome.said
    return outcome.run["reasons"][0]


@cases.case("extrinsics that are not known")
def no_extrinsics(folder):
    path, outcome = mapped(folder, [m for m in short if m.topic != "/tf_static"])
    expect_partial(outcome, "the IMU was not used for 1", "its place on the carrier is not known")
    return expect(outcome, 4, 0.1, f"{path}: the place of the IMU", "it is not used")


@cases.case("times of points that run backwards")
def backwards(folder):
    def spoil(cloud):
        times = times_of(cloud)
        last = max(times)
        for i, time in enumerate(times):
            cloud.put(i, "t", "I", last - time)

    path = folder / "walk.mcap"
    write_mcap(path, [edit_cloud(m, spoil) if m.topic == "/lidar" else m for m in messages])
    outcome = map_recording(path, folder / "run")
    assert outcome.code == 4 and "times of points do not fit the motion" in outcome.said, outcome.said
    return outcome.run["reasons"][0]


def times_of(cloud):
    at = cloud.fields["t"][0]
    return [row[0] for row in struct.iter_unpack(f"<{at}xI{cloud.step - at - 4}x", cloud.points)]


# Short runs of them were complete: the motion within scans is probed too seldom.
@cases.case("times of points in no order")
def mixed_times(folder):
    def spoil(cloud):
        times = times_of(cloud)
        random.Random(1).shuffle(times)
        for i, time in enumerate(times):
            cloud.put(i, "t", "I", time)

    _, outcome = mapped(folder, with_clouds(spoil))
    assert "scan.mixed_times" in outcome.warnings and outcome.run["evidence"]["scans_mixed_times"] > 0.9 * ALL
    return expect(outcome, 4, 0.1, "the times of points are in no order")


@cases.case("points of a scan in no order, with their times")
def mixed_rows(folder):
    def spoil(cloud):
        rows = [bytes(cloud.points[i * cloud.step : (i + 1) * cloud.step]) for i in range(len(cloud))]
        random.Random(1).shuffle(rows)
        cloud.points = bytearray(b"".join(rows))

    _, outcome = mapped(folder, with_clouds(spoil))
    assert outcome.run["evidence"]["scans_mixed_times"] == 0
    return expect(outcome, 0, 0.03)


# The path was right by itself, but the whole map leant by 6 degrees, and was complete.
@cases.case("an accelerometer that is off by 1 m/s^2")
def accelerometer_off(folder):
    _, outcome = mapped(folder, with_imu(lambda rates, forces: (rates, (forces[0] + 1, *forces[1:])), short))
    assert 4 < outcome.run["evidence"]["tilt_at_end_deg"] < 8, outcome.run["evidence"]
    return expect(outcome, 4, 0.05, "the map leans by", "the accelerometer is off by")


@cases.case("clouds far apart that are taken to be a tenth of a second apart")
def assumed_times(folder):
    """A folder of every fifteenth cloud whose names tell no times: the walk becomes a flight."""
    clouds = folder / "clouds"
    clouds.mkdir()
    for i, message in enumerate(scans[::15]):
        cloud = Cloud(message.data)
        at = [cloud.fields[name][0] for name in ("x", "y", "z", "intensity")]
        (clouds / f"{i:06}.bin").write_bytes(b"".join(
            cloud.points[k * cloud.step + offset : k * cloud.step + offset + 4]
            for k in range(len(cloud)) for offset in at))
    outcome = map_recording(clouds, folder / "run")
    assert outcome.code == 4 and outcome.run["status"] == "untrusted", outcome.said
    assert "recording.assumed_rate" in outcome.warnings
    assert "times of the clouds were assumed" in "; ".join(outcome.run["reasons"]), outcome.run["reasons"]
    return outcome.run["reasons"][0]


@cases.case("lidar that repeats one scan")
def repeated(folder):
    frozen = next(m for m in short if m.topic == "/lidar" and m.stamp > start + 6e9)
    _, outcome = mapped(folder, [
        frozen.at(m.stamp) if m.topic == "/lidar" and m.stamp > frozen.stamp else m for m in short])
    assert outcome.code == 4, outcome.said
    assert "hold the same points as the scan before" in outcome.run["reasons"][0], outcome.run["reasons"]
    return outcome.run["reasons"][0]


@cases.case("no times of points")
def no_times(folder):
    path, outcome = mapped(folder, with_clouds(lambda cloud: cloud.without("t")))
    return expect(outcome, 4, 0.3, f"{path}: /lidar: no time per point", "are smeared by")


@cases.case("points that are not numbers, or at zero range")
def no_numbers(folder):
    nothing, zero = [math.nan] * 3, [0.0] * 3

    def spoil(cloud):
        for i in range(0, len(cloud), 10):
            cloud.put(i, "x", "3f", *(nothing if i % 20 else zero))

    path, outcome = mapped(folder, with_clouds(spoil))
    assert "(10.0 %) are not a number or at zero range" in outcome.said, outcome.said
    return expect(outcome, 0, 0.03, f"{path}: /lidar: ")


@cases.case("nothing but points that are not numbers")
def all_nan(folder):
    def spoil(cloud):
        for i in range(len(cloud)):
            cloud.put(i, "x", "3f", math.nan, math.nan, math.nan)

    path, outcome = mapped(folder, [edit_cloud(m, spoil) if m.topic == "/lidar" else m
                                    for m in short if m.time < start + 2e9])
    assert outcome.code == 3 and f"{path}: none of its" in outcome.said, outcome.said
    assert not (folder / "run" / ".understory").exists()
    return outcome.said.strip().splitlines()[-1].replace(str(folder), "")


@cases.case("ten seconds without lidar")
def outage(folder):
    """The IMU carries the position across; what follows joins the map again."""
    _, outcome = mapped(folder, [m for m in messages if m.topic != "/lidar" or
                                 not start + 8e9 < m.stamp < start + 18e9])
    assert outcome.run["counts"]["segments"] == 1
    return expect(outcome, 4, 0.15, "the lidar was silent for 10.1 s before 17000000",
                  pairs=len(scans) - 100)


def error_of_part(outcome, folder, first, last, truth=truth):
    """Of a piece of the trajectory by itself, in metres."""
    part = folder / f"part_{first}.tum"
    part.write_text("".join(line + "\n" for line in outcome.poses
                            if first <= float(line.split()[0]) - start / 1e9 < last))
    done = program("evaluate", part, truth, "--align", "first", "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["ape_rmse_m"]


@cases.case("ten seconds without lidar and IMU")
def outage_of_both(folder):
    """Nothing tells of the way: a new piece of map begins. It sees trees of the old one, and is joined to it."""
    spoilt = [m for m in messages if not start + 8e9 < m.time < start + 18e9]
    _, outcome = mapped(folder, spoilt)
    assert outcome.run["status"] == "partial" and outcome.run["counts"]["segments"] == 1, outcome.said
    assert outcome.run["counts"]["segments_joined"] == 1 and "map.joined" in outcome.warnings, outcome.run["counts"]
    error, _ = error_m(outcome, truth)
    assert "lost at 17000000" in outcome.said and error < 0.1, (error, outcome.said)
    (folder / "apart").mkdir()
    _, outcome = mapped(folder / "apart", spoilt, "--set", "loop_closure.pieces.enabled=false")
    assert outcome.code == 4 and outcome.run["counts"]["segments"] == 2, outcome.said
    assert "2 pieces" in outcome.said, outcome.said
    errors = [error_of_part(outcome, folder, 0, 8), error_of_part(outcome, folder, 18, 30)]
    assert max(errors) < 0.1, errors
    return f"joined: {100 * error:.1f} cm; apart: two pieces of {100 * errors[0]:.1f} and {100 * errors[1]:.1f} cm"


@cases.case("sensors that are suddenly elsewhere")
def elsewhere(folder):
    """From one scan to the next in another stand, as when two recordings were joined."""
    _, other, true_there = good_recording(seconds=12, seed=9)
    _, outcome = mapped(folder, [m for m in short if m.time < start + 6e9] + [
        m for m in other if m.time >= start + 6e9 and m.topic != "/tf_static"])
    assert outcome.code == 4 and outcome.run["counts"]["segments"] == 2, outcome.said
    assert outcome.run["counts"]["segments_joined"] == 0, outcome.run["counts"]
    assert "could not be matched" in outcome.said and "lost at 17000000" in outcome.said
    errors = [error_of_part(outcome, folder, 0, 6),
              error_of_part(outcome, folder, 9, 12, true_there)]
    assert max(errors) < 0.1, errors
    return f"exit 4, two pieces of {100 * errors[0]:.1f} and {100 * errors[1]:.1f} cm"


@cases.case("messages twice")
def twice(folder):
    chance = random.Random(1)
    _, outcome = mapped(folder, [m for m in short for _ in range(1 + (chance.random() < 0.2))])
    assert outcome.warnings["time.duplicate"]["count"] > 300
    return expect(outcome, 0, 0.03, "second message at 17000000")


@cases.case("messages shuffled")
def shuffled(folder):
    chance = random.Random(1)
    order = sorted(short, key=lambda m: m.time + chance.uniform(-1e8, 1e8))
    order = [dataclasses.replace(m, time=start + i * 1_000_000) for i, m in enumerate(order)]
    _, outcome = mapped(folder, order)
    return expect(outcome, 0, 0.03, "came after a later one; put in order")


@cases.case("time that goes back")
def time_goes_back(folder):
    _, outcome = mapped(folder, [m.at(m.stamp - 5_000_000_000)
                                 if m.topic != "/tf_static" and m.stamp > start + 6e9 else m
                                 for m in short])
    assert outcome.code == 0 and "the clock of the recording went back by 4.99" in outcome.said
    assert abs(len(outcome.poses) - ALL) <= 1
    return outcome.said.strip().splitlines()[0]


@cases.case("scans without points")
def empty_scans(folder):
    path, outcome = mapped(folder, [
        edit_cloud(m, lambda cloud: cloud.points.clear())
        if m.topic == "/lidar" and start + 5e9 < m.stamp < start + 6e9 else m for m in short])
    return expect(outcome, 4, 0.05, "has only 0 usable points", "could not be matched")


@cases.case("topics that are not there")
def missing_topic(folder):
    for option in ("--lidar-topic", "--imu-topic"):
        path, outcome = mapped(folder, short[:100], option, "/velodyne")
        assert outcome.code == 3, outcome.code
        assert f"{path}: topic /velodyne: no such" in outcome.said and "there are /" in outcome.said
    return outcome.said.strip().replace(str(folder), "")


cases.run()
