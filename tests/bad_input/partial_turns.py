"""Recordings that begin within a turn of the lidar: a capture, and clouds whose first one is a part.
Points have times or none, and the sensor stands still or is carried. Bug: the first two scans were 25 ms
apart, and a small error between them became a great speed. A sensor that stood still was lost within
half a second."""

import dataclasses
import struct

from program import Cases, error_m, map_recording, simulated, unpacked
from recordings import Cloud, NS, read_mcap, write_capture, write_mcap

TURN_NS = 100_000_000
RECORD = 16 + 42 + 1206  # bytes of a packet in the capture
PACKET_NS = 24 * 55_296

cases = Cases()


def scans_of(*settings):
    """Two seconds on foot with a VLP-16 and no IMU: its scans, and the truth."""
    walk = simulated("demo", 5, 2, "lidar.model=VLP-16", "gnss.enabled=false", *settings)
    return [m for m in read_mcap(unpacked(walk)) if m.topic == "/lidar"], walk.with_suffix(".truth")


walks = {"stands": scans_of("carrier.still_s=60"), "moves": scans_of("carrier.still_s=0")}


def expect_found(outcome, truth, left_out):
    counts = outcome.run["counts"]
    assert counts["segments"] == 1 and counts["scans_unmatched"] == 0, (counts, outcome.said)
    assert ("scan.part" in outcome.warnings) == left_out, outcome.said
    error, pairs = error_m(outcome, truth)
    assert error < 0.05 and pairs >= 15, (error, pairs)
    return f"{100 * error:.1f} cm over {pairs} scans"


def cut_capture(path, scans, turned):
    """What a capture holds that begins when the simulated lidar has turned so far. It begins its scans
    half a turn away from where a real one does."""
    write_capture(path, scans)
    data = path.read_bytes()
    first = round(turned * TURN_NS / PACKET_NS)
    path.write_bytes(data[:24] + data[24 + first * RECORD :])


for walk, (scans, truth) in walks.items():
    # One that begins with a turn, for the others to be compared with.
    reference = cases.folder / f"{walk}.pcap"
    cut_capture(reference, scans, 0.5)
    run = map_recording(reference, cases.folder / f"{walk}.run")
    if walk == "stands":
        assert max(abs(float(x)) for p in run.poses for x in p.split()[1:4]) < 0.05, run.poses

    for turned in (0.0, 0.25, 0.5, 0.75):
        @cases.case(f"capture that begins at {turned} of a scan, sensor {walk}")
        def capture(folder, scans=scans, reference=run.folder, turned=turned):
            path = folder / "walk.pcap"
            cut_capture(path, scans, turned)
            return expect_found(map_recording(path, folder / "run"), reference, turned != 0.5)

    @cases.case(f"clouds, the first from 3/4 of a turn on, sensor {walk}")
    def clouds(folder, scans=scans, truth=truth):
        path = folder / "walk.mcap"
        write_mcap(path, [last_part(scans[0], 0.75)] + scans[1:])
        return expect_found(map_recording(path, folder / "run"), truth, True)

    @cases.case(f"clouds without times, the first a quarter, sensor {walk}")
    def timeless(folder, scans=scans, truth=truth, walk=walk):
        path = folder / "walk.mcap"
        write_mcap(path, [without_times(m) for m in [last_part(scans[0], 0.75)] + scans[1:]])
        outcome = map_recording(path, folder / "run")
        assert outcome.run["counts"]["segments"] == 1 and "scan.part" in outcome.warnings, outcome.said
        return f"exit {outcome.code}"


def last_part(message, share):
    """What the lidar measured behind that share of its turn, stamped with its first point."""
    cloud = Cloud(message.data)
    where, step = cloud.fields["t"][0], cloud.step
    begin = int(share * TURN_NS)
    kept = bytearray()
    for at in range(0, len(cloud.points), step):
        point = cloud.points[at : at + step]
        time = struct.unpack_from("<I", point, where)[0]
        if time < begin:
            continue
        struct.pack_into("<I", point, where, time - begin)
        kept += point
    cloud.points = kept
    stamp = message.stamp + begin
    cloud.stamp = (stamp // NS, stamp % NS)
    return dataclasses.replace(message, data=cloud.cdr())


def without_times(message):
    cloud = Cloud(message.data)
    cloud.without("t")
    return dataclasses.replace(message, data=cloud.cdr())


cases.run()
