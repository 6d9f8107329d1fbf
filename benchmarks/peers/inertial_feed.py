"""Scans with the IMU samples up to their ends, for peers that are fed scan by scan."""

import numpy as np
import recording


def frames(path):
    """(scan, rows of time, specific force, turn rate) of each scan: time in seconds since the first event.

    A scan is held back until the IMU covers its end. Each sample comes with one scan alone, those before
    the first scan with that one.
    """
    held, samples, start = [], [], None
    for event in recording.events(path):
        start = event.stamp_ns if start is None else start
        if not isinstance(event, recording.Imu):
            held.append(event)
            continue
        samples.append([1e-9 * (event.stamp_ns - start), *event.accel, *event.gyro])
        while held and event.stamp_ns >= held[0].stamp_ns + held[0].offsets_ns.max(initial=0):
            scan = held.pop(0)
            end = 1e-9 * (scan.stamp_ns + scan.offsets_ns.max(initial=0) - start)
            rows = [row for row in samples if row[0] < end]
            samples = samples[len(rows):]
            if rows and len(scan.points):
                yield scan, np.array(rows), 1e-9 * (scan.stamp_ns - start), start


def at_stamps(found, stamps, longest_ns):
    """Poses at the scans' stamps, between those of `found` ([(stamp in ns, 4 x 4)], in order)."""
    times = np.array([t for t, _ in found])
    poses = []
    for stamp in stamps:
        j = int(np.searchsorted(times, stamp))
        if j < len(times) and abs(times[j] - stamp) < 1000:
            poses.append((stamp, found[j][1]))
        elif 0 < j < len(times) and times[j] - times[j - 1] <= longest_ns:
            u = (stamp - times[j - 1]) / (times[j] - times[j - 1])
            poses.append((stamp, recording.interpolated(found[j - 1][1], found[j][1], u)))
    return poses
