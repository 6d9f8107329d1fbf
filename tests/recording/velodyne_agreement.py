"""The VLP-16 capture against velodyne_decoder: the same returns within the azimuth's resolution (0.03 degrees)."""

import numpy as np
import velodyne_decoder

from scans import DATA, check, read_scans, skip_without, xyz

capture = skip_without(DATA / "sample_velodyne_vlp16_gps.pcap")
ours = np.concatenate([
    np.column_stack([xyz(points), points["intensity"], points["ring"],
                     (stamp - 1453364282 * 10**9 + points["t"].astype(np.int64)) * 1e-9])
    for stamp, points in read_scans(capture)])
config = velodyne_decoder.Config()
config.min_range = 0.1
theirs = np.concatenate([
    np.column_stack([scan[:, 0:4], scan[:, 6], scan[:, 4].astype(float)
                     + (stamp.device - 1453364282)])
    for stamp, scan in velodyne_decoder.read_pcap(str(capture), config)]).astype(float)
# The capture begins within a turn; that part of a scan is left out here.
theirs = theirs[theirs[:, 5] > ours[:, 5].min() - 1e-6]
check(len(ours) == len(theirs), f"{len(ours)} points, velodyne_decoder has {len(theirs)}")
ours = ours[np.lexsort((ours[:, 4], np.round(ours[:, 5] * 1e6)))]
theirs = theirs[np.lexsort((theirs[:, 4], np.round(theirs[:, 5] * 1e6)))]
check(np.array_equal(ours[:, 3:5], theirs[:, 3:5]), "intensities or rings differ")
distance = np.linalg.norm(ours[:, :3] - theirs[:, :3], axis=1)
span = np.linalg.norm(theirs[:, :2], axis=1)
# An azimuth is given to 0.01 degrees, and theirs is rounded to that between the blocks as well. The
# rate of turn behind a packet's last block is a guess from the blocks before it.
limit = np.radians(0.03) * span + 1e-4
check((distance < limit).all(), f"largest difference {distance.max()} m")
check(np.abs(ours[:, 5] - theirs[:, 5]).max() < 2e-6, "times differ")
print(f"{len(ours)} points, difference median {1e3 * np.median(distance):.3f} mm, "
      f"largest {1e3 * distance.max():.3f} mm")
