"""The record of the peers' tables (benchmarks/peers.py). A table that is measured again replaces its
like, and all others stay. The summary names the best of the others, without those that failed."""

import sys
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "benchmarks"))

import peers  # noqa: E402


def result(name, ape_cm, cpu_ms):
    return {"name": name, "version": "1.0 (x)" if name == "FORM" else "1.0", "ape_cm": ape_cm,
            "drift": 0.1, "segments": None, "answered": 1.0, "cpu_ms": {"mean": cpu_ms},
            "peak_memory_mb": 100}


def check(condition, what):
    if not condition:
        sys.exit(f"peers_table: {what}")


def main():
    page = Path(tempfile.mkdtemp()) / "results.md"
    page.write_text(f"before\n{peers.BEGIN}\n{peers.END}\nafter\n")
    lake = [result("understory", 6.0, 5.0), result("understory, no IMU, no loops", 9.0, 7.0),
            result("DLIO", 29.5, 50.0), result("FORM", 17.2, 4.0),
            {"name": "RKO-LIO", "failed": "ended with 1: 0.5 m (of 2 m)"}]
    peers.write_results(peers.render(lake, "lake, seed 21, 60 s"), page)
    peers.write_results(peers.render([result("understory", 1.0, 5.0), result("LioSAM", 2.0, 60.0),
                                      result("RKO-LIO", 0.9, 10.0)], "evo1, seed 21, 60 s"), page)
    lake[0]["ape_cm"] = 5.5
    peers.write_results(peers.render(lake, "lake, seed 21, 60 s"), page)
    harvester = "lidar:\n  returns: 1\nimu:\n  rate_hz: 200\n  enabled: {}\ngnss:\n  enabled: false\n"
    check(peers.has_imu(harvester.format("true")) and not peers.has_imu(harvester.format("false")),
          "a site without an IMU is known by its settings")
    text = page.read_text()
    check(text.startswith("before\n") and text.endswith("\nafter\n"), "the rest of the page stays")
    record = text.split(peers.BEGIN)[1].split(peers.END)[0]
    check(list(peers.parts_of(record)) == ["evo1, seed 21, 60 s", "lake, seed 21, 60 s"],
          "a table a site, in order")
    check(record.count("understory (1.0) | yes | 5.5") == 1 and " 6.0 " not in record,
          "the new table in place of the old one")
    lines = record.strip().splitlines()
    check(lines[2] == "| evo1, seed 21, 60 s | 1.0 | 0.9 (RKO-LIO) | 5 | 10 (RKO-LIO) |", lines[2])
    check(lines[3] == "| lake, seed 21, 60 s | 5.5 | 17.2 (FORM) | 5 | 50 (DLIO) |", lines[3])


if __name__ == "__main__":
    main()
