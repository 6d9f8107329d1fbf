"""Copies of a table of stems, each spoilt in one way, as another forest or scanner might have it."""

import csv
import gzip
import math
import random

SEED = 5
NOISES_M = (0.1, 0.2)
NEAR_M = 20.0
VIEW_RAD = math.radians(105)  # to each side
CLUTTER_REACH_M = 30.0


def _half(view, draw):
    return [stem for stem in view if draw.random() < 0.5]


def _noisy(noise_m):
    def moved(view, draw):
        return [{**stem, **{c: f"{float(stem[c]) + draw.gauss(0.0, noise_m):.3f}" for c in "xyz"}}
                for stem in view]
    return moved


def _near(view, _):
    return [s for s in view if math.hypot(float(s["x"]), float(s["y"])) < NEAR_M]


def _ahead(view, _):
    return [s for s in view if abs(math.atan2(float(s["y"]), float(s["x"]))) < VIEW_RAD]


def _cluttered(view, draw):
    """Half as many again that are no stems, other ones in each view."""
    more = []
    for _ in range(len(view) // 2):
        turn, range_m = draw.uniform(-math.pi, math.pi), CLUTTER_REACH_M * math.sqrt(draw.random())
        more.append({**draw.choice(view), "x": f"{range_m * math.cos(turn):.3f}",
                     "y": f"{range_m * math.sin(turn):.3f}"})
    return view + more


WAYS = {"as it is": lambda view, _: view,
        "half of each view's stems missed": _half,
        "half as many again that are none": _cluttered,
        **{f"{100 * noise:.0f} cm of noise a coordinate": _noisy(noise) for noise in NOISES_M},
        f"only stems within {NEAR_M:.0f} m": _near,
        "210 degrees ahead": _ahead}


def spoil(source, target, way):
    """Writes `source` (stems.csv.gz) to `target`, view by view spoilt in one of WAYS."""
    views = {}
    with gzip.open(source, "rt") as file:
        rows = csv.DictReader(file)
        columns = rows.fieldnames
        for row in rows:
            views.setdefault(int(row["frame"]), []).append(row)
    draw = random.Random(SEED)
    with gzip.open(target, "wt") as file:
        table = csv.DictWriter(file, columns)
        table.writeheader()
        for _, view in sorted(views.items()):
            table.writerows(WAYS[way](view, draw))
