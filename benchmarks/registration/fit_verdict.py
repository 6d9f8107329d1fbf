"""Fits the weights by which `understory register` judges a match, on the pairs of global_pairs.

    fit_verdict.py PAIRS.json...

Prints the numbers of match_verdict::kWeights (registration/global/global_constants.h), and how many
wrong poses and right poses each limit of the chance lets through. A pose is right within 0.5 m and 2
degrees of the truth. Each pose counts twice: with and without what was seen through, as clouds that
are no single view do not tell that. Lines of verdict_pairs are read, too, and count once. On those of
scans of few rings alone, the weights are match_verdict::kSparseWeights. Needs numpy.
"""

import json
import sys
from pathlib import Path

import numpy as np

USUAL_THROUGH = -3.0  # the constants of match_verdict
THROUGH_FLOOR, NEAR_FLOOR, FINE_FLOOR = 0.003, 0.02, 0.003
NO_RIVAL = 0.7


def traits(pose, alone, blind):
    gap = NO_RIVAL if alone else min(1.0, max(-0.5, pose["score"] - pose["rival"]))
    looked = pose["looked"] > 0 and not blind
    through = np.log((pose["through"] + THROUGH_FLOOR) / (pose["near"] + NEAR_FLOOR))
    return [1.0, pose["near"], through if looked else USUAL_THROUGH,
            np.log((pose["fine"] + FINE_FLOOR) / (pose["aside"] + FINE_FLOOR)),
            np.log((pose["matched"] + 1.0) / (pose["chance"] + 1.0)), gap]


def is_right(pose):
    return pose["off_m"] < 0.5 and pose["off_deg"] < 2.0


def read(files):
    rows, right, best = [], [], []
    for file in files:
        for line in Path(file).read_text().splitlines():
            if not line.endswith("}"):
                continue  # a run that was stopped
            pair = json.loads(line)
            if "poses" not in pair:  # of verdict_pairs
                if pair["near"] > 0:
                    rows.append(traits({**pair, "chance": pair["by_chance"]}, pair["rival"] < -8,
                                       False))
                    right.append(is_right(pair))
                    best.append(True)
                continue
            poses = pair["poses"]
            for pose in poses:
                for blind in (False, True):
                    rows.append(traits(pose, len(poses) == 1, blind))
                    right.append(is_right(pose))
                    best.append(pose["how"] == "best" and not blind)
    return np.array(rows), np.array(right), np.array(best)


# What each trait must weigh at least, with its sign. Traits that go together can turn a weight
# around, and then a strong rival would speak for a pose.
LEAST = np.array([0.0, 1.0, -0.3, 1.0, 0.3, 2.0])


def fit(x, y):
    """Logistic regression; weights that fall short of LEAST are held there."""
    held = np.zeros(x.shape[1], bool)
    while True:
        w = np.where(held, LEAST, 0.0)
        w[~held] = newton(x[:, ~held], y, x[:, held] @ LEAST[held])
        short = ~held & (np.sign(LEAST) * w < np.abs(LEAST))
        if not short.any():
            return w
        held |= short


def newton(x, y, offset, ridge=0.1):
    """Logistic regression by Newton steps, the columns brought to one scale."""
    middle, scale = x.mean(0), x.std(0)
    middle[0], scale[0] = 0.0, 1.0
    z = (x - middle) / scale
    w = np.zeros(z.shape[1])
    keep = np.full(len(w), ridge)
    keep[0] = 0.0
    for _ in range(60):
        p = 1.0 / (1.0 + np.exp(-np.clip(z @ w + offset, -30, 30)))
        step = np.linalg.solve((z * (p * (1 - p))[:, None]).T @ z + np.diag(keep),
                               z.T @ (p - y) + keep * w)
        w -= step
        if np.abs(step).max() < 1e-9:
            break
    w = w / scale
    w[0] -= (w * middle)[1:].sum()
    return w


def main():
    rows, right, best = read(sys.argv[1:])
    if not len(rows):
        print(__doc__)
        return 2
    weights = fit(rows, right.astype(float))
    print("kWeights = {" + ", ".join(f"{w:.2f}" for w in weights) + "}")
    print(f"{len(rows) // 2} poses, {right.sum() // 2} right; first answers {best.sum()}, "
          f"right {(right & best).sum()}")
    chance = 1.0 / (1.0 + np.exp(-rows @ weights))
    for limit in (0.5, 0.8, 0.9, 0.95, 0.98, 0.99):
        taken = (chance >= limit) & best
        print(f"chance {limit}: {taken.sum()} answers trusted, {(taken & ~right).sum()} of them "
              f"wrong; {100 * (right & best & ~taken).sum() / (right & best).sum():.1f} % of the "
              "right ones refused")
    return 0


if __name__ == "__main__":
    sys.exit(main())
