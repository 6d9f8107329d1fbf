"""Post-processed positions as RTKLIB's own program writes them, in four forms of the .pos file. A pair
of real RINEX files (30 s, near Tokyo, 2005) is differenced against each other. All four are read alike,
and the time is UTC."""

import calendar
import csv
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
DATA = Path(os.environ.get("UNDERSTORY_DATA", "missing")) / "gnss_canopy"
ROVER, BASE, ORBITS = (DATA / name for name in ("07590920.05o", "30400920.05o", "07590920.05n"))
FIRST = calendar.timegm((2005, 4, 1, 23, 59, 47))  # 00:00:00 of GPS, 13 leap seconds
FORMS = {"degrees": (), "cartesian": ("-e",), "minutes": ("-g", "-s", ","), "calendar": ("-t",)}


def positions(name, options, folder, mode=2):
    """What georeference makes of the .pos file: (time, latitude, longitude, height, state)."""
    solution = folder / f"{name}.pos"
    files = [ROVER, *([BASE] if mode else []), ORBITS]
    subprocess.run(["rnx2rtkp", "-p", str(mode), *options, "-o", solution, *files], check=True, capture_output=True)
    run = folder / f"run_{name}"
    run.mkdir()
    (run / "trajectory.tum").write_text("".join(
        f"{FIRST + k}.0 {0.01 * k:.3f} {k % 7}.0 0 0 0 0 1\n" for k in range(3500)))
    (run / "run.json").write_text('{"command": "map", "status": "complete", "reasons": []}')
    done = subprocess.run([PROGRAM, "--quiet", "georeference", run, "--method", "closed", "--gnss", solution, "-o",
                           folder / f"out_{name}"], capture_output=True, text=True, check=False)
    assert done.returncode == 4, (name, done.returncode, done.stderr)  # the receiver stood, the run did not
    with (folder / f"out_{name}" / "gnss.csv").open() as file:
        return [(float(r["timestamp"]), float(r["latitude_deg"]), float(r["longitude_deg"]), float(r["height_m"]))
                for r in csv.DictReader(file)]


if not DATA.is_dir() or shutil.which("rnx2rtkp") is None:
    sys.exit(77)
with tempfile.TemporaryDirectory() as scratch:
    folder = Path(scratch)
    read = {name: positions(name, options, folder) for name, options in FORMS.items()}
    first = read["degrees"]
    assert len(first) >= 110 and abs(first[0][0] - FIRST) < 0.01, (len(first), first[0])
    for name, fixes in read.items():
        assert len(fixes) == len(first), (name, len(fixes))
        for one, other in zip(first, fixes):
            apart = max(abs(a - b) * scale for a, b, scale in zip(one, other, (1, 1.1e5, 1.1e5, 1)))
            assert apart < 0.005, (name, one, other)
    spread = max(fix[3] for fix in first) - min(fix[3] for fix in first)
    assert spread < 0.2, spread  # carrier phases; the first ones are not fixed yet
    alone = positions("single", (), folder, mode=0)
    away = max(abs(a[1] - first[0][1]) * 1.1e5 for a in alone)
    assert 0.1 < away < 30, away
    print(f"{len(first)} positions in {len(FORMS)} forms, heights within {spread:.3f} m; code alone up to {away:.1f} m off")
