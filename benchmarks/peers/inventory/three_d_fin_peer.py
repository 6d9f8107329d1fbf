"""3DFin: `three_d_fin_peer.py CLOUD.laz OUT.csv`. Its own command line, by the authors' defaults, with its cloth filter.

It is under the GPL and runs as a program of its own. Trees without a reliable diameter have 0 in its table: those
stay empty.
"""

import csv
import subprocess
import sys
import tempfile
from pathlib import Path

import three_d_fin

PARAMETERS = Path(three_d_fin.__file__).parent / "3DFinconfig.ini"


def main(cloud, out):
    with tempfile.TemporaryDirectory() as folder:
        program = Path(sys.executable).parent / "3DFin"
        done = subprocess.run([program, "cli", "--normalize", "--export_txt", cloud, folder, PARAMETERS],
                              capture_output=True, text=True)
        tables = list(Path(folder).glob("*_dbh_and_heights.txt"))
        if done.returncode != 0 or not tables:
            sys.exit((done.stderr.strip().splitlines() or ["no table"])[-1])
        rows = [[float(part) for part in line.split()] for line in tables[0].read_text().splitlines() if line.strip()]
    with open(out, "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["x", "y", "dbh_m", "height_m"])
        for height, diameter, x, y in rows:
            table.writerow([x, y, diameter or "", height])


if __name__ == "__main__":
    main(*sys.argv[1:])
