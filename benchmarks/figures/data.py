"""Reads what runs and simulations write, as arrays. Positions are in metres, times in seconds, velocities in m/s."""

import csv
import gzip
import re
import sqlite3
import struct
from dataclasses import dataclass

import numpy as np

TOLERANCE_S = 0.01  # of the times of two poses that are paired, as `understory evaluate` has it


@dataclass
class Path3:
    """A path: times (n), positions (n, 3), quaternions x y z w (n, 4)."""

    times: np.ndarray
    places: np.ndarray
    turns: np.ndarray

    def rotations(self):
        """Rotation matrices, (n, 3, 3)."""
        x, y, z, w = self.turns.T
        return np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
                         2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                         2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1).reshape(-1, 3, 3)

    def length_m(self):
        return float(np.linalg.norm(np.diff(self.places, axis=0), axis=1).sum())


def opened(file):
    return gzip.open(file, "rt") if str(file).endswith(".gz") else open(file, encoding="utf-8")


def read_path(file):
    rows = np.loadtxt(file, ndmin=2)
    return Path3(rows[:, 0], rows[:, 1:4], rows[:, 4:8])


def read_table(file, *columns):
    """Columns of a CSV file as an array (rows, columns); empty cells are NaN."""
    with opened(file) as text:
        rows = [[float(row[name]) if row[name] not in ("", None) else np.nan for name in columns]
                for row in csv.DictReader(text)]
    return np.array(rows).reshape(-1, len(columns))


def read_cloud(file, most=2_000_000):
    """Points of a LAZ file, (n, 3); of more than `most` an even share."""
    import laspy
    cloud = laspy.read(file)
    points = np.stack([cloud.x, cloud.y, cloud.z], axis=1)
    return points[::max(1, len(points) // most)]


def origin_of(truth):
    """Latitude, longitude (degrees) and height of the frame of a simulator's truth."""
    text = (truth / "site.yaml").read_text()
    return tuple(float(re.search(rf"^\s+{key}: ([-\d.eE+]+)", text, re.M)[1])
                 for key in ("latitude_deg", "longitude_deg", "height_m"))


def list_in_site(truth, section, key):
    """A list of numbers of the truth's site.yaml, e.g. ("gnss", "mount_m")."""
    text = (truth / "site.yaml").read_text()
    part = re.search(rf"^{section}:\n((?:\s+.*\n)+)", text, re.M)[1]
    return [float(x) for x in re.search(rf"^\s+{key}: \[([^\]]*)\]", part, re.M)[1].split(",")]


def enu(latitude, longitude, height, origin):
    """East, north, up (n, 3) of places on the ellipsoid near an origin: exact to a millimetre over a kilometre."""
    def earth_centred(lat, lon, up):
        lat, lon = np.radians(lat), np.radians(lon)
        e2 = 0.00669437999014
        radius = 6378137.0 / np.sqrt(1 - e2 * np.sin(lat) ** 2)
        return np.stack([(radius + up) * np.cos(lat) * np.cos(lon), (radius + up) * np.cos(lat) * np.sin(lon),
                         (radius * (1 - e2) + up) * np.sin(lat)], axis=-1)
    a, b = np.radians(origin[0]), np.radians(origin[1])
    axes = np.array([[-np.sin(b), np.cos(b), 0.0],
                     [-np.sin(a) * np.cos(b), -np.sin(a) * np.sin(b), np.cos(a)],
                     [np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), np.sin(a)]])
    return (earth_centred(np.asarray(latitude), np.asarray(longitude), np.asarray(height))
            - earth_centred(*map(np.asarray, origin))) @ axes.T


def paired(a, b, tolerance_s=TOLERANCE_S):
    """Indices of the times of `a` and of the nearest ones of `b`, where they are within the tolerance."""
    after = np.clip(np.searchsorted(b, a), 1, len(b) - 1) if len(b) > 1 else np.zeros(len(a), int)
    nearest = np.where(np.abs(b[after - 1] - a) < np.abs(b[after] - a), after - 1, after)
    good = np.abs(b[nearest] - a) <= tolerance_s
    return np.flatnonzero(good), nearest[good]


def rigid_fit(source, target, upright=False):
    """Rotation and shift that bring points nearest to others by least squares; upright: about z alone."""
    a, b = source.mean(axis=0), target.mean(axis=0)
    h = (source - a).T @ (target - b)
    if upright:
        angle = np.arctan2(h[0, 1] - h[1, 0], h[0, 0] + h[1, 1])
        c, s = np.cos(angle), np.sin(angle)
        rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    else:
        u, _, vt = np.linalg.svd(h)
        rotation = vt.T @ np.diag([1, 1, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
    return rotation, b - rotation @ a


def laid_on(path, onto, upright=False):
    """`path` moved onto another by all their paired poses; with the motion."""
    i, j = paired(path.times, onto.times)
    if len(i) < 3:
        raise ValueError("the paths have fewer than three poses in common")
    rotation, shift = rigid_fit(path.places[i], onto.places[j], upright)
    return moved(path, rotation, shift), rotation, shift


def moved(path, rotation, shift):
    """A path moved rigidly; its attitudes turn along."""
    w = np.sqrt(max(0.0, 1 + np.trace(rotation))) / 2
    if w < 1e-6:
        raise ValueError("a half turn")
    q = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0],
                  rotation[1, 0] - rotation[0, 1]]) / (4 * w)
    x, y, z, v = path.turns.T
    turns = np.stack([w * x + q[0] * v + q[1] * z - q[2] * y, w * y - q[0] * z + q[1] * v + q[2] * x,
                      w * z + q[0] * y - q[1] * x + q[2] * v, w * v - q[0] * x - q[1] * y - q[2] * z], axis=1)
    return Path3(path.times, path.places @ rotation.T + shift, turns)


def off_by(path, truth):
    """Times and distances of a path from a truth at the paired poses."""
    i, j = paired(path.times, truth.times)
    return path.times[i], np.linalg.norm(path.places[i] - truth.places[j], axis=1)


def rms(values):
    values = np.asarray(values)
    return float(np.sqrt(np.mean(values ** 2))) if values.size else float("nan")


def layer_path(geopackage):
    """Positions (n, 3) of the layer `path` of a trees.gpkg, in the coordinate system of the run's layers. A run that
    hardly moved has no such layer and none of them."""
    with sqlite3.connect(f"file:{geopackage}?mode=ro", uri=True) as base:
        found = base.execute("select column_name from gpkg_geometry_columns where table_name='path'").fetchone()
        blobs = [row[0] for row in base.execute(f'select "{found[0]}" from path')] if found else []
    parts = [np.empty((0, 3))]
    for blob in blobs:
        envelope = (0, 32, 48, 48, 64)[(blob[3] >> 1) & 7]
        start = 8 + envelope
        order = "<" if blob[start] else ">"
        kind, count = struct.unpack_from(f"{order}II", blob, start + 1)
        width = 3 if kind in (1002, 0x80000002) else 2
        places = np.frombuffer(blob, f"{order}f8", count * width, start + 9).reshape(-1, width)
        parts.append(places if width == 3 else np.pad(places, ((0, 0), (0, 1)), constant_values=np.nan))
    return np.concatenate(parts)
