"""How fast packets are decoded: CPU time of `understory info`, which reads a whole recording, beside what the sensor needs
to send it. Reading the file is part of it.

    benchmarks/decoding.py [--seconds 10]

Captures are made anew with random returns (tests/recording/packets.py). That of an Ouster needs the metadata of the
example data. CustomMsg of a Livox is that of the site `mid360`. Needs numpy."""

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path

import program

sys.path.insert(0, str(program.TOP / "tests" / "recording"))
import packets  # noqa: E402: found by the line above


def row(name, recording, more=()):
    done = min((program.understory("info", "--json", recording, *more) for _ in range(3)), key=lambda each: each.cpu_s)
    seen = json.loads(done.stdout)
    seconds, points = seen["duration_s"], seen["lidar"]["points"]
    print(f"| {name} | {points / seconds / 1e3:.0f} | {points / done.cpu_s / 1e6:.1f} | {seconds / done.cpu_s:.0f} |", flush=True)


def main():
    metadata = Path(os.environ.get("UNDERSTORY_DATA", program.TOP.parent / "shared" / "data")) / "drivers" \
        / "OS-1-128_v2.3.0_1024x10.json"
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10)
    options = parser.parse_args()
    print("| sensor | thousand returns a second | million a second of CPU | times the sensor's speed |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "capture.pcap"
        for sensor in packets.SENSORS:
            packets.write_capture(recording, sensor, options.seconds)
            row(sensor.name, recording)
        if metadata.exists():
            packets.write_capture(recording, packets.ouster(), options.seconds)
            row("OS-1-128", recording, ("--metadata", metadata))
        recording = Path(folder) / "mid360.mcap"
        program.understory("simulate", "mid360", "-o", recording, "--duration-s", options.seconds)
        row("CustomMsg of a Mid-360", recording)

if __name__ == "__main__":
    main()
