#!/usr/bin/env python3
"""Errors of diameters by distance and size, and the constants of diameter_sd_m fitted to them.

    build/benchmarks/stem_sizes fit FILE ... | benchmarks/stem_sizes.py [--fit] [--fit-radius] [--leave-out]

The table gives bias, RMSE and how many errors lie within one and two standard deviations. Rows are beams
that are known (compensated), beams that are not, and a cloud of which the ranges are not known, either.
--fit searches constants with which 68 % and 95 % do so in each class of 30 stems and more. --fit-radius fits those of
excess_radius_m to stems whose beams are known, each cloud with the root of its number of stems. --leave-out tells the
errors of each cloud with the constants that the others give. It also tells the biases of clouds with eight stems and
more. Needs numpy.
"""
import io
import sys

import numpy as np

DISTANCES = [(0, 4), (4, 8), (8, 15), (15, 22), (22, 30)]
SIZES = [(0.05, 0.10), (0.10, 0.20), (0.20, 9.0)]
FEWEST = 30
THIN_RADIUS = 0.03  # m: kThinRadius
# As in src/understory/forest/beam_constants.h; metres.
CONSTANTS = {"known": [2.3, 0.0057, 0.0023, 0.0074], "wide": [2.6, 0.0049, 0.0043, 0.018], "bare": [6.0, 0.003, 0.024]}


def terms_of(kind, rows):
    """Columns whose squares, times those of the constants, add up to the variance."""
    spread = 2 * rows["spread_m"]
    tens = rows["range_m"] / 10
    one_sided = np.maximum(0, 1 - rows["arc_deg"] / 360)
    ones = np.ones(len(rows))
    if kind == "known":
        return np.stack([spread, ones, tens ** 2, rows["weakness"]], 1)
    if kind == "wide":
        return np.stack([spread, ones, tens ** 2, one_sided * tens], 1)
    return np.stack([spread, ones, one_sided], 1)


def classes_of(rows):
    for low, high in DISTANCES:
        for least, most in SIZES:
            inside = (rows["path_m"] >= low) & (rows["path_m"] < high) & (rows["true_m"] >= least) & (rows["true_m"] < most)
            if inside.sum() >= FEWEST:
                yield f"{low} to {high} m, from {100 * least:.0f} to {100 * most:.0f} cm", inside


def fitted(terms, errors, groups):
    """Constants whose shares within one and two standard deviations come nearest to those of a Gaussian."""
    random = np.random.default_rng(1)

    def loss(constants):
        ratio = np.abs(errors) / np.sqrt(terms ** 2 @ constants ** 2)
        return sum(min(group.sum(), 200) * ((np.mean(ratio[group] < 1) - 0.68) ** 2 + 0.05 * (np.quantile(ratio[group], 0.95) / 2 - 1) ** 2)
                   for group in groups)

    best = None
    for _ in range(4):
        constants = random.uniform(0.2, 2.0, terms.shape[1]) * [1.0 if column.mean() < 0.1 else 0.01 for column in terms.T]
        least = loss(constants)
        for _ in range(1500):
            tried = constants * np.exp(random.normal(0, 0.3, len(constants)) * (random.random(len(constants)) < 0.5))
            value = loss(tried)
            if value < least:
                least, constants = value, tried
        if best is None or least < best[0]:
            best = (least, constants)
    return best[1]


def beam_terms(rows):
    """Stems that tell the constants of excess_radius_m: rows, what is added up with them, and the excess of the radius."""
    rows = rows[(rows["beam_m"] > 0) & (np.abs(rows["dbh_m"] - rows["true_m"]) < 0.12)]
    radius = 0.5 * rows["dbh_m"]
    one_sided = np.maximum(0, 1 - rows["arc_deg"] / 360)
    terms = np.stack([one_sided * rows["width_m"], rows["beam_m"],
                      -rows["beam_m"] ** 2 / np.maximum(radius, THIN_RADIUS)], 1)
    return rows, terms, radius - 0.5 * rows["true_m"]


def beam_constants(rows, terms, excess):
    """kOneSided, kAllSides and kBesideStem of excess_radius_m by robust least squares (Huber)."""
    sds = np.sqrt((1.4 * rows["spread_m"]) ** 2 + 0.004 ** 2 + (1.5e-5 * rows["range_m"] ** 2) ** 2)
    _, cloud, number = np.unique(rows["cloud"], return_inverse=True, return_counts=True)
    found = np.zeros(3)
    for _ in range(30):
        ratio = np.abs(excess - terms @ found) / sds
        weights = np.sqrt(np.minimum(1, 1.5 / np.maximum(ratio, 1e-9)) / sds ** 2 / np.sqrt(number[cloud]))
        found = np.linalg.lstsq(terms * weights[:, None], excess * weights, rcond=None)[0]
    return found


def fit_radius(rows):
    rows, terms, excess = beam_terms(rows)
    found = beam_constants(rows, terms, excess)
    print(f"excess_radius_m: kOneSided {found[0]:.2f}, kAllSides {found[1]:.2f}, kBesideStem {found[2]:.2f}, from {len(rows)} stems")


def leave_out(rows):
    rows, terms, excess = beam_terms(rows)
    error = np.zeros(len(rows))  # of the diameter, cm
    for cloud in np.unique(rows["cloud"]):
        rest = rows["cloud"] != cloud
        found = beam_constants(rows[rest], terms[rest], excess[rest])
        error[~rest] = 200 * (excess - terms @ found)[~rest]
    thick = rows["true_m"] >= 0.10
    print("\n| each cloud left out in turn | number | bias cm | RMSE cm | biases of clouds, RMS cm |\n|---|---|---|---|---|")
    for name, inside in [("from 10 cm, to 8 m", thick & (rows["path_m"] < 8)),
                         ("from 10 cm, 8 to 15 m", thick & (rows["path_m"] >= 8) & (rows["path_m"] < 15)),
                         ("5 to 10 cm, to 15 m", ~thick & (rows["true_m"] >= 0.05) & (rows["path_m"] < 15))]:
        clouds = [error[inside & (rows["cloud"] == cloud)] for cloud in np.unique(rows["cloud"])]
        biases = [mine.mean() for mine in clouds if len(mine) >= 8]
        print(f"| {name} | {inside.sum()} | {error[inside].mean():+.2f} | {np.sqrt(np.mean(error[inside] ** 2)):.2f} | {np.sqrt(np.mean(np.square(biases))):.2f} |")


def tell(kind, rows, fit):
    errors = rows["dbh_m"] - rows["true_m"] - (rows["excess_m"] if kind == "known" else 0)
    terms = terms_of(kind, rows)
    if fit:
        found = fitted(terms, errors, [inside for _, inside in classes_of(rows)])
        print(f"{kind}: constants {np.round(found, 4).tolist()}")
    sds = np.sqrt(terms ** 2 @ np.array(CONSTANTS[kind]) ** 2)
    print(f"\n| {kind} | number | bias cm | RMSE cm | within 1 sd | within 2 sd |\n|---|---|---|---|---|---|")
    for name, inside in [("all", np.ones(len(rows), dtype=bool))] + list(classes_of(rows)):
        error, ratio = 100 * errors[inside], np.abs(errors[inside]) / sds[inside]
        print(f"| {name} | {inside.sum()} | {error.mean():+.2f} | {np.sqrt(np.mean(error ** 2)):.2f} | {100 * np.mean(ratio < 1):.0f} % | {100 * np.mean(ratio < 2):.0f} % |")


def main():
    rows = np.genfromtxt(io.StringIO(sys.stdin.read()), delimiter=",", names=True, dtype=None, encoding="utf-8")
    if "--fit-radius" in sys.argv:
        fit_radius(rows)
    if "--leave-out" in sys.argv:
        leave_out(rows)
    for kind in CONSTANTS:
        tell(kind, rows, "--fit" in sys.argv)


if __name__ == "__main__":
    main()
