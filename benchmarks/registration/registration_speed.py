"""One pair of scans by our NDT and by small_gicp's GICP and VGICP: CPU time on one thread.

    registration_speed.py BUILD/benchmarks/registration_benchmark A.bin B.bin [ROUNDS]

Both run in turn within each round, so that whatever else the machine does falls on both; the best of
the rounds counts. small_gicp thins by voxels of 0.25 m, as its authors do.
"""

import json
import subprocess
import sys
import time

import numpy as np
import small_gicp


def read_scan(path):
    return np.fromfile(path, np.float32).reshape(-1, 4)[:, :3].astype(np.float64)


def timed(work):
    start = time.process_time()
    result = work()
    return 1e3 * (time.process_time() - start), result


def peer(target, source):
    prepare_ms, clouds = timed(lambda: [
        small_gicp.preprocess_points(cloud, downsampling_resolution=0.25, num_threads=1)
        for cloud in (target, source)])
    (a, tree), (b, _) = clouds
    gicp_ms, gicp = timed(lambda: small_gicp.align(a, b, tree, registration_type="GICP",
                                                   num_threads=1))
    voxels = small_gicp.GaussianVoxelMap(1.0)
    map_ms, _ = timed(lambda: voxels.insert(a))
    vgicp_ms, _ = timed(lambda: small_gicp.align(voxels, b, num_threads=1))
    return {"prepare_ms": prepare_ms, "gicp_ms": gicp_ms, "vgicp_map_ms": map_ms,
            "vgicp_ms": vgicp_ms}, gicp.T_target_source[:3, 3]


def main():
    program, target_file, source_file = sys.argv[1:4]
    rounds = int(sys.argv[4]) if len(sys.argv) > 4 else 5
    target, source = read_scan(target_file), read_scan(source_file)
    ours, theirs = {}, {}
    for _ in range(rounds):
        answer = json.loads(subprocess.run([program, target_file, source_file, "3"], check=True,
                                           capture_output=True, text=True).stdout)
        figures, translation = peer(target, source)
        for best, new in ((ours, answer), (theirs, figures)):
            for key, value in new.items():
                if key.endswith("_ms"):
                    best[key] = min(best.get(key, float("inf")), value)
    total = ours["thin_ms"] + ours["map_ms"] + ours["ndt_ms"]
    print(f"translation: ours {answer['translation_m']}, GICP {np.round(translation, 4).tolist()}")
    print("ours:", {key: round(value, 2) for key, value in ours.items()},
          f"{answer['iterations']} iterations")
    print("small_gicp:", {key: round(value, 2) for key, value in theirs.items()})
    print(f"whole pair, ours / GICP: {total / (theirs['prepare_ms'] + theirs['gicp_ms']):.2f}")
    print(f"match alone, ours / GICP: {ours['ndt_ms'] / theirs['gicp_ms']:.2f}, "
          f"ours / VGICP: {ours['ndt_ms'] / theirs['vgicp_ms']:.2f}")
    # Its preparation thins both clouds and finds all covariances; ours is within map and match.
    gicp = ours["thin_ms"] + ours["gicp_map_ms"] + ours["gicp_ms"]
    vgicp = ours["thin_ms"] + ours["vgicp_map_ms"] + ours["vgicp_ms"]
    print(f"our GICP / GICP, whole pair: {gicp / (theirs['prepare_ms'] + theirs['gicp_ms']):.2f}")
    print("our VGICP / VGICP, whole pair: "
          f"{vgicp / (theirs['prepare_ms'] + theirs['vgicp_map_ms'] + theirs['vgicp_ms']):.2f}")


if __name__ == "__main__":
    main()
