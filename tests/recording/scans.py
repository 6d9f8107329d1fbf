"""The scans of a recording as this project reads them."""

import os
import pathlib
import struct
import subprocess
import sys

import numpy as np

POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("t", "<u4"),
                  ("ring", "<u2"), ("return_index", "u1"), ("tag", "u1")])
DATA = pathlib.Path(os.environ["UNDERSTORY_DATA"]) / "drivers"


def skip_without(path):
    if not path.exists():
        print(f"skipped: {path} is not there")
        sys.exit(77)
    return path


def read_scans(recording, *metadata):
    """[(stamp in ns, points)]"""
    program = pathlib.Path(os.environ["UNDERSTORY_BUILD"]) / "tests" / "dump_scans"
    raw = subprocess.run([program, recording, *metadata], check=True, stdout=subprocess.PIPE).stdout
    scans, at = [], 0
    while at < len(raw):
        stamp, count = struct.unpack_from("<qQ", raw, at)
        scans.append((stamp, np.frombuffer(raw, POINT, count, at + 16)))
        at += 16 + count * POINT.itemsize
    return scans


def xyz(points):
    return np.stack([points["x"], points["y"], points["z"]], axis=1).astype(float)


def check(condition, message):
    if not condition:
        print("FAILED:", message)
        sys.exit(1)
