"""A lidar that is silent within a loop: do both parts become one map?

    benchmarks/outage.py [--seeds 3] [--silent 25 55] [--work FOLDER]

Site `handheld`, a loop of 100 m with 512 columns. Maps it as recorded, without the lidar for the seconds
of --silent, and without lidar and IMU. Prints the error of the path (SE(3)), the pieces of the map, and
the trees within 15 m of the path. Of those with 30 returns it prints how many are found, and the false
ones. The program is build/understory, or the one that UNDERSTORY_PROGRAM names. Python's standard
library only."""

import argparse
import pathlib
import sys
import tempfile

import program

sys.path.insert(0, str(program.TOP / "tests" / "bad_input"))
from recordings import read_mcap, write_mcap  # noqa: E402

SILENT = {"as recorded": (), "without lidar": ("/lidar",), "without lidar and IMU": ("/lidar", "/imu")}


def spoilt(recording, to, topics, silent):
    messages = read_mcap(recording)
    start = next(message.stamp for message in messages if message.topic == "/lidar")
    write_mcap(to, [message for message in messages
                    if message.topic not in topics or not silent[0] <= 1e-9 * (message.stamp - start) < silent[1]])
    return to


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="*", default=[3])
    parser.add_argument("--silent", type=float, nargs=2, default=[25, 55])
    parser.add_argument("--work", type=pathlib.Path)
    options = parser.parse_args()
    work = options.work or pathlib.Path(tempfile.mkdtemp())
    work.mkdir(parents=True, exist_ok=True)
    print("seed  recording              APE cm  pieces  joined  trees found  false  status")
    for seed in options.seeds:
        whole, plain, truth = work / f"{seed}.mcap", work / f"{seed}_plain.mcap", work / f"{seed}.truth"
        program.understory("simulate", "handheld", "-o", whole, "--overwrite", "--seed", seed,
                           "--set", "carrier.length_m=100", "--set", "lidar.columns=512")
        program.understory("convert", whole, plain, "--compression", "none", "--overwrite")
        for name, topics in SILENT.items():
            run = work / f"{seed}_{name.replace(' ', '_')}"
            facts = program.map_recording(spoilt(plain, work / "spoilt.mcap", topics, options.silent), run)
            errors = program.understory_json("evaluate", run, truth, "--align", "se3")
            trees = program.understory_json("evaluate", "trees", run, truth, "--align", "yaw", "--truth-returns",
                                            truth / "returns.csv.gz", "--path", truth / "trajectory.tum")["visible"]
            counts = facts["counts"]
            print(f"{seed:4}  {name:21}  {100 * errors['ape_rmse_m']:6.2f}  {counts['segments']:6}  "
                  f"{counts['segments_joined']:6}  {trees['found']:5} of {trees['expected']:<4} {trees['false']:5}  "
                  f"{facts['status']}", flush=True)


if __name__ == "__main__":
    main()
