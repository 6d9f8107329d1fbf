#!/usr/bin/env python3
"""`./run accuracy --faults`: sites whose sensors, weather or company are disturbed, beside the same site undisturbed.

  ./run accuracy --faults                        12 runs on each of four sites, 60 s each, seed 3: about an hour
  ./run accuracy --faults --seeds 41 42          other seeds; 1 to 19 are those that settings are tuned on
  ./run accuracy --faults --duration-s 30        shorter or longer cases
  ./run accuracy --faults --sites lake --only snow blind   some sites, faults with these words in their names
  ./run accuracy --faults --peers                RKO-LIO and DLIO on the same recordings
  ./run accuracy --faults --keep DIR             rows and their recordings' names go to DIR/faults.jsonl
                                                 (default out/faults); run again, it goes on where it was
  ./run accuracy --faults --table                the rows that are there, without measuring any
  ./run accuracy --faults --write                puts the table into docs/method/faults.md

Rows are kept with the version and the digest of the program. Those of another program are measured again.

Floor: the APE after the best rigid motion is at most 3 times that of the undisturbed recording or 5 cm,
whichever is more. Else the run must not be called complete, and one of its reasons names the fault.
Exit status 1 where a row misses it. Python standard library only, but for --peers.
"""

import argparse
import json
import re
import shutil
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from program import (Failed, TOP, digest, machine, map_recording, own_cpus, run, say, simulated, truth_of,
                     understory, understory_json, version)

RESULTS = TOP / "docs" / "method" / "faults.md"
BEGIN, END = "<!-- faults table: ./run accuracy --faults --write -->", "<!-- end of faults table -->"
# One of each carrier, with four scanners and four IMUs. A walker (OS0-128), and a harvester that
# shakes and sees 210 degrees (VLP-16). A UAV with a cheap IMU over small pines (VLP-16), and a fast
# sleigh in snow (RS-16).
SITES = ["handheld", "harvester", "lohja1", "lake"]
FLOOR_TIMES, FLOOR_M = 3.0, 0.05
LAST_TUNING_SEED = 19
AS_IT_IS = "as it is"
PEERS = ["RKO-LIO", "DLIO"]


@dataclass
class Fault:
    """What is changed of a site, and words of which one stands in a reason that names the fault."""
    name: str
    settings: object  # of the site; or what gives them of the site's own values and the length in s
    words: str


def noisier(site, _):
    return {f"imu.{key}": 10.0 * site["imu", key] for key in ("gyro_noise", "accel_noise")}


def gusts(site, _):
    """Tops of 15 m sway by 0.3 m; a UAV is tilted five times as far as in still air."""
    keys = {"stand.wind_sway_m": 0.3}
    if site["carrier", "kind"] == "uav":
        keys |= {"carrier.tilt_sd_deg": 5.0 * site["carrier", "tilt_sd_deg"]}
    return keys


FAULTS = [
    Fault("IMU 20 ms late", {"imu.time_offset_s": 0.02}, "clock|late|early|out of time"),
    Fault("lidar turned by 2°", {"lidar.error_rpy_deg": "[1.2,-1.1,1.2]"},
          "axes|turned|mounted|extrinsics"),
    Fault("lidar 5 cm aside", {"lidar.error_m": "[0.03,-0.03,0.026]"}, "lever|mounted|extrinsics|aside"),
    Fault("IMU noise times 10", noisier, "gyroscope|accelerometer|IMU"),
    Fault("half of the returns lost", {"lidar.dropout": 0.5}, "returns|points|matched"),
    Fault("gusts of 10 m/s", gusts, "wind|sway|matched|moves"),
    Fault("heavy snow", {"lidar.snow_fall_per_m": 0.005, "lidar.snow_drop_interval_s": 7},
          "snow|weather|points|matched"),
    Fault("two people 1.5 m behind", {"objects.followers": 2, "objects.follow_m": 1.5},
          "people|moves|near|matched"),
    Fault("lidar at 5 Hz", {"lidar.rate_hz": 5}, "apart|scans a second|rate|matched"),
    Fault("blind for 3 s a minute",
          lambda _, length: {"blindness.interval_s": min(60.0, length), "blindness.length_s": 3},
          "usable point|was lost"),
    Fault("no IMU", {"imu.enabled": "false"}, "IMU"),
]


def site_values(site):
    """The values of a site by section and key: numbers where they are such."""
    values, section = {}, ""
    for line in understory("simulate", site, "--print-site").stdout.splitlines():
        found = re.match(r"^( *)(\w+):(?: ([^#]*))?", line)
        if not found:
            continue
        indent, key, value = found.groups()
        if not indent:
            section = key
        value = (value or "").strip()
        try:
            values[section, key] = float(value)
        except ValueError:
            values[section, key] = value
    return values


def settings_of(fault, site, length_s):
    if fault is None:
        return {}
    return fault.settings(site_values(site), length_s) if callable(fault.settings) else fault.settings


class Rows:
    """Rows on disk, one a line; those of other programs do not count."""

    def __init__(self, folder):
        self.file = folder / "faults.jsonl"
        self.program = digest()
        self.version = version()
        self.rows = {}
        for line in self.file.read_text().splitlines() if self.file.exists() else []:
            row = json.loads(line)
            if row["program"] == self.program:
                self.rows[row["key"]] = row

    def lacks(self, key):
        """Whether it is to be measured: also one that failed, as a full disk or a stopped command may be why."""
        return key not in self.rows or self.rows[key]["status"] == "failed"

    def put(self, row):
        row |= {"program": self.program, "version": self.version}
        self.rows[row["key"]] = row
        with open(self.file, "a") as file:
            file.write(json.dumps(row) + "\n")


def key_of(site, seed, length_s, name, system="understory"):
    return f"{site} {seed} {length_s:g} {name} {system}"


def ape_m(trajectory, truth):
    return understory_json("evaluate", trajectory, truth, "--align", "se3")["ape_rmse_m"]


def measure_ours(work, recording, row):
    folder = work / f"run_{row['site']}"
    shutil.rmtree(folder, ignore_errors=True)
    try:
        result = map_recording(recording, folder, settings=["map.enabled=false"])
        truth = recording.with_suffix(".truth") if isinstance(recording, Path) else truth_of(folder)
        row |= {"status": result["status"], "reasons": result.get("reasons", []),
                "warnings": [w["key"] for w in result["warnings"]], "ape_m": ape_m(folder, truth)}
    except Failed as error:
        row |= {"status": "failed", "reasons": [str(error).splitlines()[-1][:200]], "warnings": [],
                "ape_m": None}
    shutil.rmtree(folder, ignore_errors=True)
    shutil.rmtree(truth_of(folder), ignore_errors=True)
    return row


def measure_peer(work, recording, row, name):
    from peers import add_errors, peer
    result = add_errors(peer(name, recording, work, own_cpus()), recording.with_suffix(".truth"))
    failed = result.get("failed")
    return row | {"status": "failed" if failed else "", "reasons": [failed] if failed else [],
                  "warnings": [], "ape_m": None if failed else result["ape_cm"] / 100.0}


def measure_case(rows, work, site, seed, length_s, fault, systems):
    """The rows of one recording: those that are not there yet."""
    name = fault.name if fault else AS_IT_IS
    missing = [s for s in systems if rows.lacks(key_of(site, seed, length_s, name, s))]
    if fault and fault.name == "no IMU":  # they need one
        missing = [s for s in missing if s not in PEERS]
    if not missing:
        return
    keys = {"seed": seed, "duration_s": length_s, **settings_of(fault, site, length_s)}
    recording = simulated(site, **keys)
    say(f"  {recording}")
    if missing != ["understory"]:
        written = work / "recording.mcap"
        words = [w for k, v in keys.items() if k not in ("seed", "duration_s") for w in ("--set", f"{k}={v}")]
        understory("simulate", site, "-o", written, "--overwrite", "--seed", seed, "--duration-s", length_s, *words)
    for system in missing:
        row = {"key": key_of(site, seed, length_s, name, system), "site": site, "seed": seed,
               "length_s": length_s, "fault": name, "system": system, "recording": recording,
               "date": time.strftime("%Y-%m-%d")}
        if system == "understory":
            row = measure_ours(work, recording if missing == ["understory"] else written, row)
        else:
            row = measure_peer(work, written, row, system)
        rows.put(row)
        error = "no path" if row["ape_m"] is None else f"{100 * row['ape_m']:.1f} cm"
        say(f"    {system}: {error} {row['status']} {'; '.join(row['reasons'])[:150]}")


def verdict(row, reference, fault):
    """(floor in m, what is said of the row, whether it meets the floor)."""
    known = reference and reference["ape_m"] is not None
    floor = max(FLOOR_M, FLOOR_TIMES * reference["ape_m"]) if known else FLOOR_M
    if row["ape_m"] is not None and row["ape_m"] <= floor:
        return floor, "met", True
    if row["status"] == "complete":
        return floor, "**wrong and complete**", False
    if any(re.search(fault.words, reason) for reason in row["reasons"]):
        return floor, "told", True
    return floor, "**not named**", False


def cell(row):
    if row is None:
        return ""
    return "no path" if row["ape_m"] is None else f"{100 * row['ape_m']:.1f}"


def table_row(rows, site, seed, length_s, fault, systems):
    """(text of one line, whether it meets the floor); None where it was not measured."""
    def found(system, name=fault.name if fault else AS_IT_IS):
        return rows.rows.get(key_of(site, seed, length_s, name, system))
    own = found("understory")
    if own is None:
        return None
    cells = [site, f"{seed}{'*' if seed <= LAST_TUNING_SEED else ''}", own["fault"], cell(own)]
    good = True
    if fault:
        floor, said, good = verdict(own, found("understory", AS_IT_IS), fault)
        cells += [f"{100 * floor:.1f}", own["status"], said]
    else:
        cells += ["", own["status"], ""]
    cells += [". ".join(own["reasons"] or [w for w in own["warnings"] if w.startswith("imu.")]).replace("|", "/")]
    return "| " + " | ".join(cells + [cell(found(s)) for s in systems[1:]]) + " |", good


def render(rows, options, systems):
    head = ["site", "seed", "fault", "APE cm", "floor cm", "status", "", "reasons, or warnings of the IMU",
            *[f"{s}: APE cm" for s in systems[1:]]]
    lines = [f"{rows.version}, {time.strftime('%Y-%m-%d')}, {machine()}. {options.duration_s:g} s each.", "",
             "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    missed = 0
    for site in options.sites:
        for seed in options.seeds:
            for fault in [None, *options.faults]:
                line = table_row(rows, site, seed, options.duration_s, fault, systems)
                if line is None:
                    continue
                lines.append(line[0])
                missed += not line[1]
    if any(seed <= LAST_TUNING_SEED for seed in options.seeds):
        lines += ["", f"\\* settings are tuned on seeds up to {LAST_TUNING_SEED}: not a result."]
    return "\n".join(lines) + "\n", missed


def write_results(text, page=RESULTS):
    head, rest = page.read_text().split(BEGIN, 1)
    page.write_text(f"{head}{BEGIN}\n{text}{END}{rest.split(END, 1)[1]}")
    say(f"written into {page}")


def arguments():
    parser = argparse.ArgumentParser(prog="./run accuracy --faults", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", nargs="+", default=SITES, metavar="SITE", help=f"default: {' '.join(SITES)}")
    parser.add_argument("--seeds", type=int, nargs="+", default=[3])
    parser.add_argument("--duration-s", type=float, default=60.0, help="of each recording; at least 20")
    parser.add_argument("--only", nargs="+", metavar="WORD", help="faults with one of these in their names")
    parser.add_argument("--peers", action="store_true", help="RKO-LIO and DLIO too")
    parser.add_argument("--keep", type=Path, default=TOP / "out" / "faults", metavar="DIR")
    parser.add_argument("--table", action="store_true", help="measure nothing: the rows that are there")
    parser.add_argument("--write", action="store_true", help="put the table into docs/method/faults.md")
    options = parser.parse_args()
    options.faults = [f for f in FAULTS if not options.only or any(w in f.name for w in options.only)]
    if not options.faults:
        parser.error(f"--only: no fault has that in its name: {', '.join(f.name for f in FAULTS)}")
    if options.duration_s < 20.0:
        parser.error("--duration-s: at least 20, as a path of some length has to follow the start")
    known = {line.split()[0] for line in understory("simulate", "--list").stdout.splitlines() if line.strip()}
    if unknown := [site for site in options.sites if site not in known]:
        parser.error(f"--sites: unknown: {', '.join(unknown)}")
    return options


def main():
    options = arguments()
    options.keep.mkdir(parents=True, exist_ok=True)
    rows = Rows(options.keep)
    systems = ["understory", *(PEERS if options.peers else [])]
    for site in options.sites if not options.table else []:
        for seed in options.seeds:
            for fault in [None, *options.faults]:
                measure_case(rows, options.keep, site, seed, options.duration_s, fault, systems)
    text, missed = render(rows, options, systems)
    print(text)
    if options.write:
        write_results(text)
    say(f"{missed} of the rows miss their floor" if missed else "all rows meet their floor")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
