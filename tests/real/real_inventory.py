"""`understory inventory` on two real clouds: exactly the stems that the eye finds.

Pines scanned by a mobile scanner, and a plantation by a terrestrial one whose whorls of branches
must not become stems. The places are the program's own; each was looked at in cross sections 0.9 to
1.9 m above the ground and from the side, and found to be a stem, and no other ring was found there.
The mobile cloud's diameters agree with those from a cloud of the same stand that was flown.
"""

import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
DATA = Path(os.environ.get("UNDERSTORY_DATA", "missing"))
MOBILE = DATA / "spanner_mls_uas_als" / "MLS_Clip.laz"
FLOWN = DATA / "spanner_mls_uas_als" / "UAS_Clip.laz"
PLANTATION = DATA / "treels" / "pine_plot.laz"
MOBILE_ORIGIN = (470624.0, 3810208.0)
MOBILE_STEMS = [
    (5.3, 21.2), (5.6, 28.8), (8.2, 26.2), (10.7, 33.6), (11.7, 26.2), (12.1, 22.6), (14.1, 39.0),
    (14.2, 20.0), (14.2, 28.2), (15.2, 19.8), (17.3, 33.8), (17.7, 38.8), (17.8, 33.8),
    (18.2, 21.6), (18.3, 39.7), (19.6, 24.3), (20.7, 20.1), (21.3, 31.5), (22.6, 30.2),
    (23.2, 25.1), (24.2, 23.2), (24.3, 35.8), (24.5, 25.6), (27.7, 38.1), (27.7, 29.2),
    (28.9, 36.5), (29.1, 15.8)]
PLANTATION_STEMS = [
    (0.2, 2.0), (0.4, 0.0), (0.4, 4.0), (0.5, 8.2), (0.5, 6.0), (3.4, 3.5), (3.4, 5.6), (3.5, 1.4),
    (3.5, 7.6), (6.2, 1.0), (6.4, 4.7), (8.0, 4.6), (9.3, 7.5), (9.3, 5.4), (9.3, 3.4), (9.4, 1.2)]
FLOWN_SHIFT_M = 0.65  # of the flown cloud to the east of the mobile one
REACH_M = 0.3


def inventory(cloud, folder):
    run = folder / cloud.stem
    status = subprocess.run([PROGRAM, "inventory", str(cloud), "-o", str(run)],
                            capture_output=True, text=True, check=False)
    assert status.returncode in (0, 4), status.stderr
    with open(run / "trees.csv", encoding="utf-8") as file:
        return [{key: float(value) for key, value in row.items() if value}
                for row in csv.DictReader(file)]


def pairs(trees, places):
    """(tree, place) one to one, nearest first."""
    near = sorted((((t["x"] - x) ** 2 + (t["y"] - y) ** 2) ** 0.5, i, j)
                  for i, t in enumerate(trees) for j, (x, y) in enumerate(places))
    found = {}
    taken = set()
    for distance, i, j in near:
        if distance <= REACH_M and i not in found and j not in taken:
            found[i] = j
            taken.add(j)
    return found


def check_stems(trees, places, name):
    found = pairs(trees, places)
    missed = [p for j, p in enumerate(places) if j not in found.values()]
    false = [(t["x"], t["y"]) for i, t in enumerate(trees) if i not in found]
    print(f"{name}: {len(found)} of {len(places)} stems, missed {missed}, not stems {false}")
    assert not missed and not false


def check_diameters(mobile, flown):
    places = [(t["x"] + FLOWN_SHIFT_M, t["y"]) for t in mobile]
    differences = sorted(abs(flown[i]["dbh_m"] - mobile[j]["dbh_m"])
                         for i, j in pairs(flown, places).items())
    middle = differences[len(differences) // 2]
    print(f"diameters of {len(differences)} stems from the air: median difference {middle:.3f} m")
    assert len(differences) >= 14
    assert middle < 0.025


def main():
    if not MOBILE.exists() or not PLANTATION.exists():
        return 77
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        mobile = inventory(MOBILE, folder)
        places = [(MOBILE_ORIGIN[0] + x, MOBILE_ORIGIN[1] + y) for x, y in MOBILE_STEMS]
        check_stems(mobile, places, "mobile")
        check_stems(inventory(PLANTATION, folder), PLANTATION_STEMS, "plantation")
        check_diameters(mobile, inventory(FLOWN, folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
