"""The OS-1-128 capture, point by point within 1 mm of ouster-sdk."""

import numpy as np
from ouster.sdk import open_source

try:
    from ouster.sdk import core
except ImportError:  # before 1.0, which other packages may hold back
    from ouster.sdk import client as core

from scans import DATA, check, read_scans, skip_without, xyz

capture = skip_without(DATA / "OS-1-128_v2.3.0_1024x10_lb_n3.pcap")
metadata = DATA / "OS-1-128_v2.3.0_1024x10.json"
ours = read_scans(capture)
source = open_source(str(capture), meta=[str(metadata)])
info = source.sensor_info[0] if hasattr(source, "sensor_info") else source.metadata
table = core.XYZLut(info)
theirs = list(source)
check(len(ours) == len(theirs), f"{len(ours)} scans, ouster-sdk has {len(theirs)}")
for (stamp, points), scans in zip(ours, theirs):
    scan = scans if isinstance(scans, core.LidarScan) else scans[0]
    ranges = scan.field("RANGE")
    rows, columns = np.nonzero(ranges)
    order = np.lexsort((rows, columns))  # column after column, from the top beam down
    rows, columns = rows[order], columns[order]
    expected = table(scan)[rows, columns]
    times = scan.timestamp.astype(np.int64)[columns]
    check(len(points) == len(expected), f"{len(points)} points, ouster-sdk has {len(expected)}")
    error = np.abs(xyz(points) - expected).max()
    check(error < 1e-3, f"a point is {error} m off")
    check(np.array_equal(stamp + points["t"].astype(np.int64), times), "times differ")
    print(f"{len(points)} points, largest difference {1e6 * error:.1f} um, times equal")
