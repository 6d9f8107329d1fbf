#!/usr/bin/env python3
"""Simulated scans beside real ones: docs/pictures/realism.png and the tables of docs/method/simulation.md.

    realism.py [--data FOLDER] [--out PICTURE]

Real: a pine stand by mobile laser, from an unmanned aircraft and from an aeroplane
(spanner_mls_uas_als), and a pine plot by terrestrial laser (treels). Also one scan of a VLP-16 in a park
(evalio_botanic), and scans of a VLP-16 and an OS1-128 in streets (drivers). Simulated: a pine stand as
`understory map` maps it, and scans of a VLP-16. The same code judges real and simulated clouds; nothing
of it knows the truth. Needs numpy, scipy, laspy and matplotlib. Only curves and figures leave the
script, never the data's points."""
import argparse
import math
import os
import pathlib
import subprocess
import tempfile

import laspy
import matplotlib
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = pathlib.Path(os.environ.get("UNDERSTORY_PROGRAM", ROOT / "build/understory"))
# The real stand: pines of 20 m, stems of 25 to 30 cm, the crown above half of the height.
PINES = ["stand.size_x_m=44", "stand.size_y_m=44", "stand.trees_per_ha=500", "stand.pine_share=1",
         "stand.spruce_share=0", "stand.dbh_mean_m=0.27", "stand.dbh_sd_m=0.05", "stand.dbh_min_m=0.15",
         "stand.height_mean_m=19", "stand.shrubs_per_ha=100", "stand.seedlings_per_ha=100"]
# The same stand from a VLP-16 that looks down from 45 m.
FROM_ABOVE = [key for key in PINES if "size" not in key] + [
    "stand.size_x_m=90", "stand.size_y_m=90", "stand.dbh_max_m=0.6", "stand.spacing_m=2", "stand.edge_m=0",
    "stand.crown_base_share=0", "carrier.height_m=45", "carrier.route_time_s=0", "carrier.speed_m_s=4",
    "lidar.mount_rpy_deg=[0,90,0]", "lidar.rays_per_beam=4"]


# ---- simulated clouds ------------------------------------------------------------------------

def simulated_scans(site, settings, seed, duration_s, every):
    """Points of single scans of a site, in the lidar's frame."""
    with tempfile.TemporaryDirectory() as folder:
        recording = pathlib.Path(folder) / "r.mcap"
        command = [PROGRAM, "simulate", site, "-o", recording, "--seed", str(seed),
                   "--duration-s", str(duration_s)]
        for setting in settings:
            command += ["--set", setting]
        subprocess.run(command, check=True, capture_output=True)
        subprocess.run([PROGRAM, "convert", recording, pathlib.Path(folder) / "clouds", "--format", "bin"],
                       check=True, capture_output=True)
        files = sorted((pathlib.Path(folder) / "clouds").glob("*.bin"))
        return [np.fromfile(f, np.float32).reshape(-1, 4)[:, :3].astype(float) for f in files[::every]]


def simulated_map(site, settings, seed, duration_s):
    """The map that the program makes of a simulated recording."""
    with tempfile.TemporaryDirectory() as folder:
        keys = "&".join([f"seed={seed}", f"duration_s={duration_s}", *settings])
        subprocess.run([PROGRAM, "map", f"sim:{site}?{keys}", "-o", pathlib.Path(folder) / "run"],
                       check=True, capture_output=True)
        return read_las(pathlib.Path(folder) / "run/map.laz")


# ---- clouds of stands ------------------------------------------------------------------------

def thinned(points, cell):
    _, first = np.unique(np.floor(points / cell).astype(np.int64), axis=0, return_index=True)
    return points[np.sort(first)]


def above_ground(points, cell=1.0):
    """Heights above the lowest points of the neighbourhood."""
    index = np.floor(points[:, :2] / cell).astype(int)
    low = {}
    for key, z in zip(map(tuple, index), points[:, 2]):
        low[key] = min(z, low.get(key, 1e9))
    keys = np.array(list(low))
    values = np.array(list(low.values()))
    tree = cKDTree((keys + 0.5) * cell)
    smooth = np.array([np.median(values[tree.query_ball_point(k, 1.5 * cell)]) for k in (keys + 0.5) * cell])
    ground = np.minimum(smooth + 0.15, values)
    _, nearest = cKDTree((keys + 0.5) * cell).query(points[:, :2], k=3)
    return points[:, 2] - ground[nearest].mean(axis=1)


def shares(points, heights):
    """Ground, stem and foliage by the shape of the neighbourhood alone (30 cm, of a cloud of one point
    in 8 cm). A stem's points lie in an upright surface or line."""
    tree = cKDTree(points)
    rng = np.random.default_rng(1)
    sample = rng.choice(len(points), min(20000, len(points)), replace=False)
    upright = np.zeros(len(sample), bool)
    for n, i in enumerate(sample):
        near = points[tree.query_ball_point(points[i], 0.3)]
        if len(near) < 5:
            continue
        values, vectors = np.linalg.eigh(np.cov((near - near.mean(axis=0)).T))
        upright[n] = values[1] < 0.35 * values[2] and abs(vectors[2, 2]) > 0.9
    h = heights[sample]
    ground = h < 0.3
    stem = ~ground & upright
    return np.array([ground.mean(), stem.mean(), (~ground & ~stem).mean()])


def circle(points):
    """Least-squares circle, robust: centre, radius, standard deviation of the middle of the residuals."""
    start = np.append(np.median(points, axis=0), 0.13)
    fit = least_squares(lambda c: np.hypot(points[:, 0] - c[0], points[:, 1] - c[1]) - c[2], start,
                        loss="soft_l1", f_scale=0.02)
    left = np.hypot(points[:, 0] - fit.x[0], points[:, 1] - fit.x[1]) - fit.x[2]
    return fit.x, 1.4826 * np.median(np.abs(left - np.median(left))), left


def cross_sections(points, heights):
    """Stems of the slice around 1.3 m: radius, spread of bark about the circle, share of it seen."""
    slice_ = points[np.abs(heights - 1.3) < 0.1][:, :2]
    tree = cKDTree(slice_)
    left = np.ones(len(slice_), bool)
    rows = []
    for i in range(len(slice_)):
        if not left[i]:
            continue
        cluster, queue = [], [i]
        left[i] = False
        while queue:
            j = queue.pop()
            cluster.append(j)
            for k in tree.query_ball_point(slice_[j], 0.08):
                if left[k]:
                    left[k] = False
                    queue.append(k)
        if len(cluster) < 30:
            continue
        (x, y, radius), spread, _ = circle(slice_[cluster])
        if not 0.05 < radius < 0.35 or spread > 0.04:
            continue
        angles = np.arctan2(slice_[cluster][:, 1] - y, slice_[cluster][:, 0] - x)
        seen = len(np.unique(np.floor(angles / (math.pi / 18)))) / 36
        if seen > 0.4:
            rows.append((radius, spread, seen, len(cluster)))
    return np.array(rows)


# ---- single scans of a VLP-16 ----------------------------------------------------------------

def stems_of_scan(points):
    """Arcs of 8 to 60 cm in single rings that lie above each other in three rings or more. Each stem has
    its range, returns, rings and the spread of range about a circle, ring by ring."""
    r = np.linalg.norm(points, axis=1)
    keep = (r > 1.5) & (r < 30)
    points, r = points[keep], r[keep]
    elevation = np.degrees(np.arcsin(points[:, 2] / r))
    ring = np.round((elevation + 15) / 2).astype(int)
    on_ring = np.abs(elevation - (2 * ring - 15)) < 0.6
    arcs = []
    for k in range(16):
        mine = points[(ring == k) & on_ring]
        if len(mine) < 4:
            continue
        mine = mine[np.argsort(np.arctan2(mine[:, 1], mine[:, 0]))]
        flat = np.hypot(mine[:, 0], mine[:, 1])
        step = np.abs(np.diff(flat)) > 0.12
        turn = np.diff(np.arctan2(mine[:, 1], mine[:, 0])) > np.radians(0.7)
        for arc in np.split(np.arange(len(mine)), np.flatnonzero(step | turn) + 1):
            width = np.linalg.norm(mine[arc[-1], :2] - mine[arc[0], :2])
            if len(arc) < 4 or not 0.08 < width < 0.6:
                continue
            middle = mine[arc].mean(axis=0)
            out = middle[:2] / np.linalg.norm(middle[:2])
            depth = mine[arc][:, :2] @ out
            side = mine[arc][:, :2] @ np.array([-out[1], out[0]])
            ends = 0.5 * (depth[0] + depth[-1])
            if depth[len(arc) // 2] > ends + 0.02:  # hollow: no stem
                continue
            bend = np.polyfit(side, depth, 2)
            arcs.append((middle, len(arc), np.std(depth - np.polyval(bend, side), ddof=min(3, len(arc) - 1))))
    stems, used = [], np.zeros(len(arcs), bool)
    for i, (middle, _, _) in enumerate(arcs):
        if used[i]:
            continue
        group = [j for j, other in enumerate(arcs)
                 if not used[j] and np.linalg.norm(other[0][:2] - middle[:2]) < 0.25]
        if len(group) < 3:
            continue
        used[group] = True
        z = [arcs[j][0][2] for j in group]
        if max(z) - min(z) < 0.35:
            continue
        spread = np.median([arcs[j][2] for j in group if arcs[j][1] >= 6] or [np.nan])
        stems.append((np.linalg.norm(middle[:2]), sum(arcs[j][1] for j in group), len(group), spread))
    return np.array(stems).reshape(-1, 4)


def returns_by_range(points):
    r = np.linalg.norm(points, axis=1)
    edges = np.arange(0, 60, 2.0)
    counts, _ = np.histogram(r, edges)
    return 0.5 * (edges[1:] + edges[:-1]), counts / max(1, len(r))


# ---- single ranges ---------------------------------------------------------------------------

def scans_of(recording, *options):
    """Scans of a recording as read_pcd gives them, the first eight."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([PROGRAM, "convert", recording, folder, "--format", "pcd", *options], check=True,
                       capture_output=True)
        return [read_pcd(f) for f in sorted(pathlib.Path(folder).glob("*.pcd"))[:8]]


def read_pcd(path):
    """Fields by name of a binary PCD."""
    raw = pathlib.Path(path).read_bytes()
    end = raw.index(b"DATA binary\n") + len(b"DATA binary\n")
    head = dict(line.split(" ", 1) for line in raw[:end].decode().splitlines() if not line.startswith("#"))
    kinds = {"F4": "<f4", "F8": "<f8", "U1": "u1", "U2": "<u2", "U4": "<u4", "I4": "<i4", "U8": "<u8"}
    fields = [(name, kinds[kind + size]) for name, kind, size
              in zip(head["FIELDS"].split(), head["TYPE"].split(), head["SIZE"].split())]
    return np.frombuffer(raw, np.dtype(fields), int(head["POINTS"]), end)


def range_noise(clouds):
    """Spread of single ranges on smooth surfaces, by range. It comes from the second differences of
    neighbours in a ring, where seven in a row lie within 15 cm of a straight course. Rows of (from, to,
    sd, count)."""
    ranges, noises = [], []
    for cloud in clouds:
        xyz = np.stack([cloud["x"], cloud["y"], cloud["z"]], axis=1).astype(float)
        r = np.linalg.norm(xyz, axis=1)
        azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
        for ring in np.unique(cloud["ring"]):
            mine = np.flatnonzero((cloud["ring"] == ring) & (r > 1.5))
            if len(mine) < 50:
                continue
            mine = mine[np.argsort(azimuth[mine])]
            step = np.diff(azimuth[mine])
            usual = np.median(step)
            second = r[mine][:-2] - 2 * r[mine][1:-1] + r[mine][2:]
            even = (step[:-1] < 1.5 * usual) & (step[1:] < 1.5 * usual) & (np.abs(second) < 0.15)
            smooth = np.convolve(even, np.ones(5), "same") > 4.5
            noises.append(second[smooth] / math.sqrt(6.0))
            ranges.append(r[mine][1:-1][smooth])
    ranges, noises = np.concatenate(ranges), np.concatenate(noises)
    rows = []
    for low, high in ((2, 5), (5, 10), (10, 20), (20, 40)):
        mine = noises[(ranges >= low) & (ranges < high)]
        if len(mine) > 200:
            rows.append((low, high, 1.4826 * np.median(np.abs(mine)), len(mine)))
    return rows


# ---- the page --------------------------------------------------------------------------------

def read_las(path):
    return np.asarray(laspy.read(path).xyz)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--data", default=os.environ.get("UNDERSTORY_DATA", ROOT.parent / "shared/data"))
    parser.add_argument("--out", default=ROOT / "docs/pictures/realism.png")
    options = parser.parse_args()
    data = pathlib.Path(options.data)

    def middle(cloud):
        return cloud[(np.abs(cloud[:, :2] - np.median(cloud[:, :2], axis=0)) < 13).all(axis=1)]

    airborne = data / "spanner_mls_uas_als"
    stands = {"real, mobile": read_las(airborne / "MLS_Clip.laz"),
              "real, terrestrial": read_las(data / "treels/pine_plot.laz"),
              "simulated": middle(simulated_map("demo", PINES + ["carrier.length_m=60"], 31, 45)),
              "real, UAS": read_las(airborne / "UAS_Clip.laz"),
              "real, ALS": read_las(airborne / "ALS_Clip.laz"),
              "simulated, UAS": middle(simulated_map("lohja1", FROM_ABOVE, 31, 60))}
    figure, axes = plt.subplots(2, 3, figsize=(15, 8.5))
    print(f"{'cloud':20}{'points':>9}{'ground':>8}{'stem':>7}{'foliage':>9}{'stems':>7}{'radius cm':>11}"
          f"{'bark sd mm':>12}{'seen %':>8}   quartiles of height / top")
    for number, (name, cloud) in enumerate(stands.items()):
        colour = f"C{number}"
        cloud = thinned(cloud - cloud.min(axis=0), 0.01)
        heights = above_ground(cloud)
        ok = (heights > -0.5) & (heights < 40)
        cloud, heights = cloud[ok], heights[ok]
        sections = cross_sections(cloud, heights)
        _, few = np.unique(np.floor(cloud / 0.08).astype(np.int64), axis=0, return_index=True)
        cloud, heights = cloud[few], heights[few]
        parts = shares(cloud, heights)
        top = np.percentile(heights, 99.5)
        standing = heights[heights > 0.1 * top] / top
        counts, edges = np.histogram(standing, np.linspace(0.1, 1.05, 39), density=True)
        axes[0, 0].plot(counts, 0.5 * (edges[1:] + edges[:-1]), colour, label=name)
        if len(sections):
            values = np.sort(1e3 * sections[:, 1])
            axes[0, 1].plot(values, (np.arange(len(values)) + 0.5) / len(values), ".-",
                            color=colour, label=name)
            section = [len(sections), 100 * np.median(sections[:, 0]), 1e3 * np.median(sections[:, 1]),
                       100 * np.median(sections[:, 2])]
        else:
            section = [0, math.nan, math.nan, math.nan]
        print(f"{name:20}{len(cloud):9d}{100 * parts[0]:8.0f}{100 * parts[1]:7.0f}{100 * parts[2]:9.0f}"
              f"{section[0]:7d}{section[1]:11.1f}{section[2]:12.1f}{section[3]:8.0f}"
              + "".join(f"{value:7.2f}" for value in np.percentile(standing, [25, 50, 75])), flush=True)
        axes[0, 2].bar(np.arange(3) + 0.14 * number, 100 * parts, 0.13, color=colour, label=name)

    botanic = np.loadtxt(data / "evalio_botanic/lidar_botanic_garden.csv", delimiter=",")[:, :3]
    park = ["stand.trees_per_ha=250", "stand.pine_share=0.3", "stand.spruce_share=0.1",
            "stand.dbh_mean_m=0.22", "stand.shrubs_per_ha=200", "lidar.model=VLP-16",
            "lidar.divergence_mrad=3.0", "lidar.beam_exit_m=0.0127", "lidar.range_sd_m=0.012",
            "lidar.range_sd_per_m=0.0002", "lidar.range_step_m=0.002", "lidar.max_range_m=100",
            "lidar.range_10_percent_m=60", "carrier.height_m=1.1", "stand.size_x_m=120", "stand.size_y_m=120",
            "carrier.length_m=150", "lidar.rays_per_beam=4"]
    scans = {"real, park": [botanic],
             "simulated": simulated_scans("demo", park, 31, 60, 15)}
    print(f"\n{'scans of a VLP-16':20}{'scans':>7}{'returns':>9}{'stems':>7}{'spread mm':>11}"
          f"{'returns x range':>17}{'rings x range':>15}")
    for name, clouds in scans.items():
        stems = np.vstack([stems_of_scan(cloud) for cloud in clouds])
        axes[1, 0].plot(stems[:, 0], stems[:, 1], "o" if len(clouds) == 1 else ".", label=name, alpha=0.7)
        axes[1, 1].plot(stems[:, 0], 1e3 * stems[:, 3], "o" if len(clouds) == 1 else ".", label=name,
                        alpha=0.7)
        ranges, share = returns_by_range(np.vstack(clouds))
        axes[1, 2].plot(ranges, 100 * share, label=name)
        print(f"{name:20}{len(clouds):7d}{np.mean([len(c) for c in clouds]):9.0f}"
              f"{len(stems) / len(clouds):7.1f}{1e3 * np.nanmedian(stems[:, 3]):11.1f}"
              f"{np.median(stems[:, 1] * stems[:, 0]):17.0f}{np.median(stems[:, 2] * stems[:, 0]):15.0f}",
              flush=True)
    # Between buildings, without plants: mostly bare ground.
    plain = ("duration_s=1.5&stand.trees_per_ha=0&stand.buildings=2&stand.shrubs_per_ha=0&"
             "stand.seedlings_per_ha=0&stand.ground_plants_per_ha=0&terrain.roughness_m=0&"
             "terrain.hummock_m=0&lidar.max_range_m=100&lidar.range_10_percent_m=60&seed=31")
    drivers = data / "drivers"
    ouster = drivers / "OS-1-128_v2.3.0_1024x10"
    noises = {"real VLP-16": scans_of(drivers / "sample_velodyne_vlp16_gps.pcap"),
              "real OS1-128": scans_of(f"{ouster}_lb_n3.pcap", "--metadata", f"{ouster}.json"),
              "simulated VLP-16": scans_of("sim:demo?lidar.model=VLP-16&lidar.divergence_mrad=3.0&"
                                           "lidar.range_sd_per_m=0.0002&lidar.range_step_m=0.002&" + plain),
              "simulated OS1-128": scans_of("sim:demo?lidar.model=OS1-128&" + plain)}
    print("\nnoise of single ranges on smooth surfaces, mm (by range)")
    for name, clouds in noises.items():
        print(f"{name:20}" + "  ".join(f"{low}-{high} m: {1e3 * sd:.1f} ({count})"
                                       for low, high, sd, count in range_noise(clouds)), flush=True)
    titles = ["height of returns above a tenth (one in 8 cm)", "spread of bark about a circle at 1.3 m",
              "ground, stem, foliage by shape", "returns of a stem in one scan",
              "spread of range across a stem, ring by ring", "returns by range"]
    labels = [("density", "height / top"), ("robust sd, mm", "share of stems"), ("", "%"),
              ("range, m", "returns"), ("range, m", "mm"), ("range, m", "% of returns")]
    for axis, title, (x, y) in zip(axes.flat, titles, labels):
        axis.set_title(title)
        axis.set_xlabel(x)
        axis.set_ylabel(y)
        axis.legend(fontsize=8)
        axis.grid(alpha=0.3)
    axes[0, 2].set_xticks([0.35, 1.35, 2.35], ["ground", "stem", "foliage"])
    axes[1, 0].set_yscale("log")
    figure.tight_layout()
    pathlib.Path(options.out).parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(options.out, dpi=70)


if __name__ == "__main__":
    main()
