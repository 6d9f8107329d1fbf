"""TreeQSM of PyTLidar: `tree_qsm_peer.py CLOUD.las OUT.csv`. One tree a cloud; the volume is that of its trunk.

It is under the GPL and runs as a program of its own, by its defaults (one set of patches).
"""

import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path


def main(cloud, out):
    with tempfile.TemporaryDirectory() as folder:
        program = Path(sys.executable).parent / "pytlidar-qsm"
        done = subprocess.run([program, Path(cloud).resolve(), "--normalize", "--outputdirectory", folder],
                              capture_output=True, text=True, env={**os.environ, "QT_QPA_PLATFORM": "offscreen"})
        tables = list(Path(folder).glob("results/treedata_*.txt"))
        if not tables:
            sys.exit((done.stderr.strip().splitlines() or ["no model"])[-1])
        figures = dict(line.split("\t", 1) for line in tables[0].read_text().splitlines() if "\t" in line)
    with open(out, "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["dbh_m", "height_m", "volume_m3"])
        table.writerow([float(figures["DBHqsm"]), float(figures["TreeHeight"]), float(figures["TrunkVolume"]) / 1000.0])


if __name__ == "__main__":
    main(*sys.argv[1:])
