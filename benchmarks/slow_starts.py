"""Sites that begin with a slow turn on the spot: does the IMU help there, or does the program doubt it?

    benchmarks/slow_starts.py [--sites hover swing] [--seeds 1 2 3 ...] [--work FOLDER]

The seed draws the tilt of the lidar (0 to 40 degrees), the rate of the turn (5 to 40 degrees/s), its angle and side. Even
seeds have even ground, odd ones rough ground. Each recording is mapped with its IMU and without it. Prints the error of
the path against the truth (SE(3)), the scans without a match of their own, and what was warned of. The program is
build/understory, or the one that UNDERSTORY_PROGRAM names. Python's standard library only."""

import argparse
import pathlib
import random
import tempfile

import program

AFTER_S = 6  # of the drive or flight
WAYS = {"imu": (), "alone": ("motion.imu_enabled=false",)}
ROUGH = {"terrain.hummock_m": 0.2, "terrain.roughness_m": 0.05, "terrain.relief_m": 0.7, "terrain.slope_deg": 2}


def drawn(seed):
    """The keys of a site that the seed draws, and how long the recording is, seconds."""
    chance = random.Random(1000 + seed)
    tilt, rate = chance.uniform(0, 40), chance.uniform(5, 40)
    angle = chance.choice([-1, 1]) * min(120, rate * chance.uniform(2.5, 4.5))
    still = abs(angle) / rate + 1.0 + chance.uniform(1, 2.5)
    keys = {"carrier.still_s": f"{still:.2f}", "carrier.first_turn_deg": f"{angle:.1f}",
            "carrier.first_turn_rate_deg_s": f"{rate:.1f}", "lidar.mount_rpy_deg": f"[0,{tilt:.1f},0]"}
    if seed % 2 == 1:
        keys.update(ROUGH)
    return keys, still + AFTER_S


def recorded(work, site, seed):
    recording = work / f"{site}{seed}.mcap"
    keys, seconds = drawn(seed)
    if not recording.exists():
        settings = [word for key, value in keys.items() for word in ("--set", f"{key}={value}")]
        program.understory("simulate", site, "-o", recording, "--seed", seed, "--duration-s", f"{seconds:.1f}", *settings)
    return recording


def measured(recording, folder, way):
    """APE in metres, scans, those without a match, exit status and warnings of a run."""
    run = program.map_recording(recording, folder, settings=("map.enabled=false", *WAYS[way]))
    errors = program.understory_json("evaluate", folder, recording.with_suffix(".truth"), "--align", "se3")
    unmatched = run["counts"]["scans_unmatched"] + run["counts"]["scans_velocity_gated"]
    return errors["ape_rmse_m"], run["scans"], unmatched, run["status"], [w["key"] for w in run["warnings"]]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sites", nargs="*", default=["hover", "swing"])
    parser.add_argument("--seeds", type=int, nargs="*", default=range(1, 21))
    parser.add_argument("--work", type=pathlib.Path)
    options = parser.parse_args()
    work = options.work or pathlib.Path(tempfile.mkdtemp())
    work.mkdir(parents=True, exist_ok=True)
    print("site    seed  tilt  deg/s  ground  way    APE_cm  scans  unmatched  status     warnings")
    for site in options.sites:
        sums = {way: [] for way in WAYS}
        scans = unmatched = 0
        for seed in options.seeds:
            recording = recorded(work, site, seed)
            keys, _ = drawn(seed)
            for way in WAYS:
                error, count, without, status, warnings = measured(recording, work / f"{site}{seed}_{way}", way)
                sums[way].append(error)
                if way == "imu":
                    scans, unmatched = scans + count, unmatched + without
                print(f"{site:7} {seed:4}  {keys['lidar.mount_rpy_deg'].split(',')[1]:>4}  "
                      f"{keys['carrier.first_turn_rate_deg_s']:>5}  {'rough' if seed % 2 else 'even':6}  {way:5}  "
                      f"{100 * error:6.2f}  {count:5}  {without:9}  {status:9}  {' '.join(warnings)}", flush=True)
        for way, errors in sums.items():
            print(f"{site}, {way}: mean APE {100 * sum(errors) / len(errors):.2f} cm, worst {100 * max(errors):.2f} cm")
        print(f"{site}, imu: {100 * (1 - unmatched / scans):.2f} % of {scans} scans with a match", flush=True)


if __name__ == "__main__":
    main()
