"""Recordings spoilt so that the map made of them is wrong: the ways, as changes of a list of messages.

A way gets a `Walk` (messages in order, as tests/bad_input/recordings.py reads them) and a random source,
and gives back a spoilt one. `Walk.true_time` says for each stamp of a scan when it was really taken.
None: nothing true can be said of it (a scan of another recording).
"""

import dataclasses
import math
import struct
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests" / "bad_input"))
from recordings import Cloud, edit_imu, read_mcap, write_mcap  # noqa: E402, F401

NS = 1_000_000_000
LIDAR, IMU = "/lidar", "/imu"
FLOAT = 7  # PointField's number of float32


@dataclass
class Walk:
    messages: list
    true_time: dict = field(default_factory=dict)  # stamp as recorded -> stamp as it was
    extrinsics: str = ""  # YAML for --extrinsics; empty: those of the recording
    options: tuple = ()  # of `understory map`
    folder: bool = False  # to be written as a folder of clouds without times

    @property
    def scans(self):
        return [m for m in self.messages if m.topic == LIDAR]


def whole(messages):
    return Walk(messages, {m.stamp: m.stamp for m in messages if m.topic == LIDAR})


def without_imu(walk):
    return dataclasses.replace(walk, messages=[m for m in walk.messages if m.topic != IMU])


def _in_order(messages):
    return sorted(messages, key=lambda m: m.time)


def _begin(walk):
    return walk.scans[0].stamp


def _length(walk):
    scans = walk.scans
    return scans[-1].stamp - scans[0].stamp


def _with_scans(walk, scans, true_time):
    """The walk with these scans in place of its own; the messages in order of time."""
    rest = [m for m in walk.messages if m.topic != LIDAR]
    return dataclasses.replace(walk, messages=_in_order(rest + scans), true_time=true_time)


def _restamped(walk, pairs):
    """Scans at other stamps: (scan, new stamp)."""
    true_time = {stamp: walk.true_time.get(scan.stamp) for scan, stamp in pairs}
    return _with_scans(walk, [scan.at(stamp) for scan, stamp in pairs], true_time)


class Points:
    """The columns of a cloud as views of its bytes."""

    def __init__(self, cloud):
        names = sorted(cloud.fields, key=lambda name: cloud.fields[name][0])
        kinds = {1: "i1", 2: "u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4", 8: "<f8"}
        self.table = np.frombuffer(cloud.points, dtype=np.dtype({
            "names": names, "formats": [kinds[cloud.fields[n][1]] for n in names],
            "offsets": [cloud.fields[n][0] for n in names], "itemsize": cloud.step}))

    def __getitem__(self, name):
        return self.table[name]

    @property
    def xyz(self):
        return np.stack([self.table[n] for n in "xyz"], axis=1).astype(np.float64)

    def put_xyz(self, xyz):
        for i, name in enumerate("xyz"):
            self.table[name] = xyz[:, i]


def _clouds(walk, change, which=lambda i: True):
    """The walk with `change(points)` applied to the clouds that `which` chooses by number."""
    out, i = [], 0
    for message in walk.messages:
        if message.topic == LIDAR:
            if which(i):
                cloud = Cloud(message.data)
                change(Points(cloud))
                message = dataclasses.replace(message, data=cloud.cdr())
            i += 1
        out.append(message)
    return dataclasses.replace(walk, messages=out)


def _imu(walk, change):
    return dataclasses.replace(walk, messages=[
        edit_imu(m, change) if m.topic == IMU else m for m in walk.messages])


def turn(axis, degrees):
    """Rotation matrix about a unit axis."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = math.radians(degrees)
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


# --- Times of scans ------------------------------------------------------------------------------


def _assumed_times(step):
    def spoil(walk, draw):
        scans = walk.scans[draw.randrange(step)::step]
        true_time = {round(i * 1e8): walk.true_time[s.stamp] for i, s in enumerate(scans)}
        return Walk(scans, true_time, folder=True)
    return spoil


def _scaled_times(factor):
    """The lidar's clock runs `factor` times as fast as the IMU's."""
    def spoil(walk, draw):
        begin = _begin(walk)
        return _restamped(walk, [(s, begin + round((s.stamp - begin) * factor))
                                 for s in walk.scans])
    return spoil


def _shuffled_times(reach):
    """Scans change places within groups of `reach`."""
    def spoil(walk, draw):
        scans, pairs = walk.scans, []
        for at in range(0, len(scans), reach):
            group = scans[at:at + reach]
            stamps = [s.stamp for s in group]
            draw.shuffle(stamps)
            pairs += zip(group, stamps)
        return _restamped(walk, pairs)
    return spoil


def _swapped_blocks(seconds):
    """Blocks of scans change places, two by two."""
    def spoil(walk, draw):
        scans, n = walk.scans, max(1, round(seconds * 1e9 * len(walk.scans) / _length(walk)))
        blocks = [scans[at:at + n] for at in range(0, len(scans), n)]
        for k in range(1, len(blocks) - 2, 3):
            if len(blocks[k + 1]) == len(blocks[k]):
                blocks[k], blocks[k + 1] = blocks[k + 1], blocks[k]
        order = [s for block in blocks for s in block]
        return _restamped(walk, [(s, slot.stamp) for s, slot in zip(order, scans)])
    return spoil


def _thinned(step):
    def spoil(walk, draw):
        scans = walk.scans[::step]
        return _with_scans(walk, scans, {s.stamp: walk.true_time[s.stamp] for s in scans})
    return spoil


def _copied(copies):
    """Of `copies` scans in a row all are the first one, at their own stamps."""
    def spoil(walk, draw):
        scans = walk.scans
        pairs = [(scans[i - i % copies], scans[i].stamp) for i in range(len(scans))]
        moved = _restamped(walk, pairs)
        moved.true_time = {s.stamp: s.stamp for s in scans}
        return moved
    return spoil


def _frozen(from_share, to_share):
    """The driver repeats one scan while the carrier goes on."""
    def spoil(walk, draw):
        scans = walk.scans
        first, last = (round(share * len(scans)) for share in (from_share, to_share))
        pairs = [(scans[first] if first <= i < last else scans[i], scans[i].stamp)
                 for i in range(len(scans))]
        moved = _restamped(walk, pairs)
        moved.true_time = {s.stamp: s.stamp for s in scans}
        return moved
    return spoil


def _gap(seconds, imu_too):
    """No scans for a while in the middle; with `imu_too` nothing else either."""
    def spoil(walk, draw):
        begin = _begin(walk) + round(0.4 * _length(walk))
        end = begin + seconds * NS
        keep = [m for m in walk.messages
                if not (begin <= m.time < end and (m.topic == LIDAR or imu_too))]
        return dataclasses.replace(walk, messages=keep)
    return spoil


# --- Times of points -----------------------------------------------------------------------------


def _point_times(change):
    def spoil(walk, draw):
        def edit(points):
            points["t"][:] = np.clip(change(points["t"].astype(np.float64)), 0, 2**32 - 1)
        return _clouds(walk, edit)
    return spoil


def _reversed_times(t):
    return t.max() - t


# --- The IMU -------------------------------------------------------------------------------------


def _imu_clock(seconds):
    def spoil(walk, draw):
        sign = draw.choice([-1, 1])
        moved = [m.at(m.stamp + round(sign * seconds * NS)) if m.topic == IMU else m
                 for m in walk.messages]
        return dataclasses.replace(walk, messages=_in_order(moved))
    return spoil


def _imu_turned(matrix):
    def both(rates, forces):
        return tuple(matrix @ np.array(rates)), tuple(matrix @ np.array(forces))
    return lambda walk, draw: _imu(walk, both)


def _imu_scaled(rate, force):
    return lambda walk, draw: _imu(walk, lambda r, f: ([rate * v for v in r],
                                                       [force * v for v in f]))


def _imu_frozen(from_share):
    """The IMU's driver repeats its last sample."""
    def spoil(walk, draw):
        samples = [m for m in walk.messages if m.topic == IMU]
        last = samples[round(from_share * len(samples))]
        return dataclasses.replace(walk, messages=[
            last.at(m.stamp) if m.topic == IMU and m.stamp > last.stamp else m
            for m in walk.messages])
    return spoil


def _imu_noise(rate_sd, force_sd):
    def spoil(walk, draw):
        return _imu(walk, lambda r, f: ([v + draw.gauss(0, rate_sd) for v in r],
                                        [v + draw.gauss(0, force_sd) for v in f]))
    return spoil


def _imu_drift(rate):
    """A gyroscope whose bias is far beyond what one can be."""
    return lambda walk, draw: _imu(walk, lambda r, f: ([r[0], r[1], r[2] + rate], f))


def _imu_of(other_name):
    """The IMU of another carrier; `other` is put in by the caller."""
    def spoil(walk, draw, other):
        begin, there = _begin(walk), _begin(other)
        rest = [m for m in walk.messages if m.topic != IMU]
        imu = [m.at(m.stamp - there + begin) for m in other.messages if m.topic == IMU]
        return dataclasses.replace(walk, messages=_in_order(rest + imu))
    spoil.needs_other = other_name
    return spoil


# --- Extrinsics ----------------------------------------------------------------------------------


def _lidar_turned(degrees):
    """The lidar is mounted otherwise than the recording says: its points are turned."""
    def spoil(walk, draw):
        axis = np.array([draw.gauss(0, 1) for _ in range(3)])
        matrix = turn(axis / np.linalg.norm(axis), degrees)
        return _clouds(walk, lambda points: points.put_xyz(points.xyz @ matrix.T))
    return spoil


def _lidar_moved(metres):
    def spoil(walk, draw):
        angle = draw.uniform(0, 2 * math.pi)
        lever = metres * np.array([math.cos(angle), math.sin(angle), 0.0])
        return _clouds(walk, lambda points: points.put_xyz(points.xyz + lever))
    return spoil


# --- Clouds --------------------------------------------------------------------------------------


def _mirrored(walk, draw):
    def edit(points):
        points["y"][:] = -points["y"]
    return _clouds(walk, edit)


def _scaled_clouds(factor):
    return lambda walk, draw: _clouds(walk, lambda points: points.put_xyz(factor * points.xyz))


def _range_bias(metres):
    def edit(points):
        xyz = points.xyz
        ranges = np.maximum(np.linalg.norm(xyz, axis=1, keepdims=True), 0.1)
        points.put_xyz(xyz * (1.0 + metres / ranges))
    return lambda walk, draw: _clouds(walk, edit)


def _mixed_in(run, period):
    """Of every `period` scans the last `run` are another recording's."""
    def spoil(walk, draw, other):
        theirs, scans, true_time = other.scans, [], {}
        for i, scan in enumerate(walk.scans):
            foreign = i % period >= period - run and i < len(theirs)
            scans.append(theirs[i].at(scan.stamp) if foreign else scan)
            true_time[scan.stamp] = None if foreign else scan.stamp
        return _with_scans(walk, scans, true_time)
    spoil.needs_other = True
    return spoil


def _half_turned(share):
    """The scanner slips in its mount: from a moment on its clouds are turned about the vertical."""
    def spoil(walk, draw):
        first = round(share * len(walk.scans))
        matrix = turn((0.0, 0.0, 1.0), draw.choice([-1, 1]) * 40.0)
        return _clouds(walk, lambda points: points.put_xyz(points.xyz @ matrix.T),
                       lambda i: i >= first)
    return spoil


@dataclass
class Way:
    name: str
    spoil: object
    cause: str  # a word of which one at least stands in the reason that names the cause (|-separated)
    imu: str = "with"  # "with", "without", "both": recordings it is done to
    withstood: bool = False  # made no wrong map of the seeds 1 and 2

    @property
    def of_imu_alone(self):
        return self.name.startswith(("IMU", "gyroscope", "accelerometer"))


IMU_WORDS = "gyroscope|accelerometer|IMU|specific force|gravity"
TIME_WORDS = "time|clock|stamp|speed|turn rate|acceleration"
MATCH_WORDS = "matched|lost|found again|points"
REPEAT_WORDS = "same scan|repeat|identical"

AXES_SWAPPED = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]])

WAYS = [
    Way("folder of every 20th cloud, 10 Hz assumed", _assumed_times(20), "assumed"),
    Way("folder of every 10th cloud, 10 Hz assumed", _assumed_times(10), "assumed"),
    Way("folder of every 5th cloud, 10 Hz assumed", _assumed_times(5), "assumed"),
    Way("lidar's clock twice as fast", _scaled_times(2.0), TIME_WORDS,
        withstood=True),
    Way("lidar's clock half as fast", _scaled_times(0.5), TIME_WORDS),
    Way("scans shuffled among 5", _shuffled_times(5), TIME_WORDS + "|" + MATCH_WORDS, "both"),
    Way("scans shuffled among 20", _shuffled_times(20), TIME_WORDS + "|" + MATCH_WORDS, "both"),
    Way("times of points reversed", _point_times(_reversed_times), "times of points|time per point",
        "both"),
    Way("times of points ten times too long", _point_times(lambda t: 10 * t),
        "times of points|time per point|point", "both"),
    Way("times of points all zero", _point_times(lambda t: 0 * t),
        "times of points|time per point", "both"),
    Way("IMU's clock off by 0.1 s", _imu_clock(0.1), "clock|" + IMU_WORDS),
    Way("IMU's clock off by 0.3 s", _imu_clock(0.3), "clock|" + IMU_WORDS,
        withstood=True),
    Way("IMU's clock off by 1 s", _imu_clock(1.0), "clock|" + IMU_WORDS),
    Way("IMU's x and y swapped", _imu_turned(AXES_SWAPPED), IMU_WORDS,
        withstood=True),
    Way("IMU turned by 90 degrees", _imu_turned(turn((0, 0, 1.0), 90)), IMU_WORDS,
        withstood=True),
    Way("IMU turned by 180 degrees", _imu_turned(turn((1.0, 0, 0), 180)), IMU_WORDS),
    Way("gyroscope in degrees per second", _imu_scaled(180 / math.pi, 1.0), IMU_WORDS),
    Way("accelerometer in g, gyroscope in degrees", _imu_scaled(180 / math.pi, 1 / 9.81),
        IMU_WORDS),
    Way("IMU repeats one sample from a third on", _imu_frozen(0.33), IMU_WORDS),
    Way("IMU of ten times the noise and more", _imu_noise(0.5, 5.0), IMU_WORDS,
        withstood=True),
    Way("gyroscope that drifts by 20 degrees a second", _imu_drift(0.35), IMU_WORDS,
        withstood=True),
    Way("IMU of another carrier", _imu_of("other"), IMU_WORDS),
    Way("lidar's extrinsics wrong by 10 degrees", _lidar_turned(10), IMU_WORDS + "|mounted",
        withstood=True),
    Way("lidar's extrinsics wrong by 45 degrees", _lidar_turned(45), IMU_WORDS + "|mounted",
        withstood=True),
    Way("lidar's extrinsics wrong by 180 degrees", _lidar_turned(180), IMU_WORDS + "|mounted"),
    Way("lever arm wrong by 3 m", _lidar_moved(3.0), "lever|" + IMU_WORDS),
    Way("every 5th scan", _thinned(5), MATCH_WORDS + "|speed|apart", "both"),
    Way("every 10th scan", _thinned(10), MATCH_WORDS + "|speed|apart", "both"),
    Way("every 20th scan", _thinned(20), MATCH_WORDS + "|speed|apart", "both"),
    Way("blocks of 4 s swapped", _swapped_blocks(4), MATCH_WORDS + "|" + TIME_WORDS, "both"),
    Way("blocks of 1 s swapped", _swapped_blocks(1), MATCH_WORDS + "|" + TIME_WORDS, "both"),
    Way("every third scan of another recording", _mixed_in(1, 3), MATCH_WORDS, "both"),
    Way("3 of every 10 s of another recording", _mixed_in(30, 100), MATCH_WORDS, "both"),
    Way("half of the recording another one", _mixed_in(300, 600), MATCH_WORDS, "both"),
    Way("gap of 5 s", _gap(5, True), "silent|lost", "both"),
    Way("gap of 15 s", _gap(15, True), "silent|lost", "both"),
    Way("gap of 30 s, IMU goes on", _gap(30, False), "silent|lost"),
    Way("each scan three times", _copied(3), REPEAT_WORDS, "both"),
    Way("lidar frozen for a fifth", _frozen(0.5, 0.7), REPEAT_WORDS, "both"),
    Way("lidar frozen from half on", _frozen(0.5, 1.0), REPEAT_WORDS, "both"),
    Way("clouds mirrored", _mirrored, IMU_WORDS + "|mirror"),
    Way("clouds in feet", _scaled_clouds(3.28084), IMU_WORDS + "|scale|unit"),
    Way("clouds in millimetres", _scaled_clouds(1000.0), "no result"),
    Way("clouds 1.2 times too large", _scaled_clouds(1.2), IMU_WORDS + "|scale|unit"),
    Way("ranges 1 m too long", _range_bias(1.0), "ranges"),
    Way("lidar slips in its mount", _half_turned(0.5), MATCH_WORDS + "|" + IMU_WORDS, "both"),
]


# Real clouds that were thinned out: of every 57, one is there.
APART = Way("real clouds 5.6 s apart (Newer College)", None, "apart|matched|found few")


def write_folder(path, walk):
    """KITTI's .bin clouds with bare numbers for names: nothing tells their times."""
    path.mkdir(parents=True)
    for i, message in enumerate(walk.scans):
        points = Points(Cloud(message.data))
        np.stack([points["x"], points["y"], points["z"], points["intensity"]],
                 axis=1).astype("<f4").tofile(path / f"{i:06}.bin")
