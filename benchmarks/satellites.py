"""`./run bench satellites`: fixes as penalties of the matches, as factors of the graph, as both, and as nothing (P3-8).

Each site is simulated once, with the receiver that it has (which degrades under canopy), with `--rtk` with RTK all the
way (`gnss.canopy_sd_m=0.03` without jumps). All ways map the same recording, without loop closure unless `--loops`.
APE: RMS after moving the path by heading and place; in the plane; attitude. End against start: error of the last pose
where the first is right. Entropy: mean map entropy, lower is crisper. Python standard library only."""

import argparse
import sys
import tempfile
from pathlib import Path

from program import Failed, machine, map_recording, say, understory, understory_json, version

SITES = ("lake", "forest", "skidoo")
WAYS = {"none": (), "penalty": ("gnss.match.use=penalty",), "graph": ("gnss.use=fuse",),
        "both": ("gnss.match.use=penalty", "gnss.use=fuse"), "prior": ("gnss.match.use=prior",)}
RTK = ("gnss.canopy_sd_m=0.03", "gnss.jump_interval_s=0")


def record(site, options, folder):
    words = []
    for setting in (*(RTK if options.rtk else ()), *options.simulate):
        words += ["--set", setting]
    if options.seconds:
        words += ["--duration-s", options.seconds]
    recording = folder / f"{site}.mcap"
    understory("simulate", site, "-o", recording, "--seed", options.seed, *words)
    return recording


def row(recording, way, options, folder):
    settings = [*WAYS[way], *options.set]
    settings += [] if options.loops else ["loop_closure.enabled=false"]
    settings += ["map.thin_m=0.1"] if options.entropy else ["map.enabled=false"]
    result = map_recording(recording, folder / way, settings=settings)
    truth = recording.with_suffix(".truth")
    errors = understory_json("evaluate", folder / way, truth, "--align", "yaw")
    cells = [f"{errors['ape_rmse_m']:.3f}", f"{errors['ape_plane_rmse_m']:.3f}", f"{errors['ape_rotation_rmse_deg']:.2f}",
             f"{errors['drift_end_m']:.3f}"]
    if options.entropy:
        cells.append(f"{understory_json('evaluate', 'map', folder / way)['mean_entropy_nats']:.3f}")
    used = result["counts"].get("scans_by_satellites", 0)
    return [*cells, f"{used} of {result['scans']}", f"{result['stages']['scan']['cpu_ms']['mean']:.0f}", result["status"]]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sites", nargs="+", default=SITES)
    parser.add_argument("--ways", nargs="+", default=["none", "penalty", "graph", "both"], choices=list(WAYS))
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=300.0, help="0: whole")
    parser.add_argument("--rtk", action="store_true")
    parser.add_argument("--loops", action="store_true")
    parser.add_argument("--entropy", action="store_true")
    parser.add_argument("--set", nargs="+", default=[], help="settings of map", metavar="KEY=VALUE")
    parser.add_argument("--simulate", nargs="+", default=[], help="settings of the site", metavar="KEY=VALUE")
    options = parser.parse_args()
    columns = ["site", "fixes", "APE m", "plane m", "attitude deg", "end against start m",
               *(["entropy nats"] if options.entropy else []), "scans by fixes", "CPU ms a scan", "status"]
    print(f"version {version()}, {machine()}, seed {options.seed}\n\n| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    for site in options.sites:
        with tempfile.TemporaryDirectory() as scratch:
            say(site)
            recording = record(site, options, Path(scratch))
            for way in options.ways:
                try:
                    cells = row(recording, way, options, Path(scratch))
                except Failed as failure:
                    cells = [str(failure)]
                print(f"| {' | '.join([site, way, *cells])} |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
