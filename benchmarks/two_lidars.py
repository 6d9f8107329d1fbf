"""Two lidars on one machine: is their merged scan better than each of them alone?

    benchmarks/two_lidars.py [--seeds 5 6 7] [--seconds 45] [--work FOLDER]

Site `harvester2`, the clock of the first lidar 30 ms late, that of the second 30 ms early. `calibrate lidars` finds both.
Then both lidars, and each alone, are mapped with these clocks. Prints how far off the clocks are, and the error of the
path against the truth (SE(3)). The truth has the poses of both lidars' scans. The program is build/understory, or the one
that UNDERSTORY_PROGRAM names. Python's standard library only."""

import argparse
import pathlib
import re
import tempfile

import program

LATE_S = (0.03, -0.03)
WAYS = {"merged": "/lidar,/lidar_2", "first": "/lidar", "second": "/lidar_2"}


def clocks_of(rig):
    return [float(late) for late in re.findall(r"late_s: (\S+)", (rig / "extrinsics.yaml").read_text())]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="*", default=[5, 6, 7])
    parser.add_argument("--seconds", type=float, default=45)
    parser.add_argument("--work", type=pathlib.Path)
    options = parser.parse_args()
    work = options.work or pathlib.Path(tempfile.mkdtemp())
    work.mkdir(parents=True, exist_ok=True)
    print("seed  clocks off, ms   APE mm: " + "   ".join(WAYS))
    sums = dict.fromkeys(WAYS, 0.0)
    for seed in options.seeds:
        recording, rig = work / f"{seed}.mcap", work / f"rig{seed}"
        program.understory("simulate", "harvester2", "-o", recording, "--overwrite", "--seed", seed, "--duration-s", options.seconds,
                           "--set", f"lidar.time_offset_s={LATE_S[0]}", "--set", f"second_lidar.time_offset_s={LATE_S[1]}")
        program.understory("calibrate", "lidars", recording, "--lidar-topic", WAYS["merged"], "-o", rig, "--overwrite")
        off = [1e3 * abs(found - late) for found, late in zip(clocks_of(rig), LATE_S)]
        line = []
        for way, topics in WAYS.items():
            run = work / f"{seed}_{way}"
            program.map_recording(recording, run, settings=("map.enabled=false",),
                                  more=("--lidar-topic", topics, "--extrinsics", rig / "extrinsics.yaml"))
            errors = program.understory_json("evaluate", run, recording.with_suffix(".truth"), "--align", "se3")
            line.append(1e3 * errors["ape_rmse_m"])
            sums[way] += line[-1]
        print(f"{seed:4}  {off[0]:5.2f} {off[1]:5.2f}            " + "   ".join(f"{error:6.2f}" for error in line), flush=True)
    print("mean " + " " * 20 + "   ".join(f"{total / len(options.seeds):6.2f}" for total in sums.values()))


if __name__ == "__main__":
    main()
