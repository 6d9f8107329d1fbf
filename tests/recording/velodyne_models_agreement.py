"""Captures of a VLP-16 in dual return, an HDL-32E and a VLP-32C with random returns (packets.py),
against velodyne_decoder. Returns, rings, intensities and times are the same, and places to 0.01 degrees.

The manuals of HDL-32E and VLP-32C give no height at which a beam leaves the optics. velodyne_decoder
lets all beams cross in one point, as those of a VLP-16 do. Its points lie higher by that point's
distance from the axis times the slope of the beam, 20 mm at most. This is taken out here."""

import pathlib
import tempfile

import numpy as np
import velodyne_decoder
from packets import SENSORS, START_NS, write_capture
from scans import check, read_scans, xyz

# Distance of the crossing from the axis in m, and the elevation of the rings in degrees.
MODELS = {"VLP-16, dual": (velodyne_decoder.Model.VLP16, 0.0), "HDL-32E": (velodyne_decoder.Model.HDL32E, 0.0289),
          "VLP-32C": (velodyne_decoder.Model.VLP32C, 0.0424)}
X, Y, Z, INTENSITY, RING, MICROSECONDS = range(6)


def in_order(rows):
    """By ring, firing and range: the returns of a firing share their time."""
    rows = rows[np.lexsort([rows[:, MICROSECONDS], rows[:, RING]])]
    firing = np.cumsum(np.diff(rows[:, MICROSECONDS], prepend=0.0) > 5.0)
    return rows[np.lexsort([np.hypot(rows[:, X], rows[:, Y]), firing, rows[:, RING]])]


def decoded(name, model):
    sensor = next(each for each in SENSORS if each.name == name)
    config = velodyne_decoder.Config()
    config.model, config.min_range, config.max_range = model, 0.1, 300.0
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "walk.pcap"
        write_capture(file, sensor, 0.5)
        ours = [np.column_stack([xyz(points), points["intensity"], points["ring"],
                                 (stamp - START_NS + points["t"].astype(np.int64)) * 1e-3])
                for stamp, points in read_scans(file)]
        theirs = [np.column_stack([scan[:, 0:4], scan[:, 6],
                                   1e6 * (scan[:, 4].astype(float) + (stamp.device - START_NS * 1e-9))])
                  for stamp, scan in velodyne_decoder.read_pcap(str(file), config)]
    return in_order(np.concatenate(ours)), in_order(np.concatenate(theirs).astype(float))


for name, (model, crossing) in MODELS.items():
    ours, theirs = decoded(name, model)
    check(len(ours) == len(theirs) > 200_000, f"{name}: {len(ours)} returns, velodyne_decoder has {len(theirs)}")
    check(np.array_equal(ours[:, INTENSITY:RING + 1], theirs[:, INTENSITY:RING + 1]), f"{name}: intensities or rings differ")
    check(np.abs(ours[:, MICROSECONDS] - theirs[:, MICROSECONDS]).max() < 0.5, f"{name}: times differ")
    span = np.hypot(ours[:, X], ours[:, Y])
    slope = ours[:, Z] / span
    higher = theirs[:, Z] - ours[:, Z] + crossing * slope
    flat = np.abs(np.hypot(theirs[:, X], theirs[:, Y]) - span)
    turned = np.abs(np.angle(np.exp(1j * (np.arctan2(ours[:, Y], ours[:, X]) - np.arctan2(theirs[:, Y], theirs[:, X])))))
    allowed = np.radians(0.01) * np.hypot(span, ours[:, Z]) + 1e-4
    check((np.abs(higher) < allowed).all(), f"{name}: a return is {np.abs(higher).max()} m higher")
    check((flat < allowed).all(), f"{name}: a range is {flat.max()} m off")
    check(turned.max() < np.radians(0.03), f"{name}: an azimuth is {np.degrees(turned.max())} degrees off")
    print(f"{name}: {len(ours)} returns, at most {1e3 * np.abs(higher).max():.2f} mm in height, {1e3 * flat.max():.2f} mm in "
          f"range and {np.degrees(turned.max()):.4f} degrees apart")
