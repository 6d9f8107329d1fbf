"""Fits the weights of features/stem_score.cc to the traits of simulated frames.

    build/benchmarks/stem_frames lieksa2 11 900 --traits a.csv      (and others)
    python benchmarks/stem_score.py a.csv b.csv ... > weights.txt

Each row: right (0 or 1), range, levels, radius, then the traits of a chain. The model is a logistic
regression on the standardised traits, their squares, and products. Products are with the first trait
(how many sections) and with the last (how finely the stem is sampled)."""
import sys

import numpy as np


def design(z):
    n = z.shape[1]
    first = [z[:, [0]] * z[:, [j]] for j in range(1, n)]
    last = [z[:, [n - 1]] * z[:, [j]] for j in range(1, n - 1)]
    return np.hstack([np.ones((len(z), 1)), z, z * z] + first + last)


def fit(a, y, ridge=1e-5, rounds=60):
    w = np.zeros(a.shape[1])
    for _ in range(rounds):
        p = 1.0 / (1.0 + np.exp(-np.clip(a @ w, -30, 30)))
        curvature = p * (1 - p) + 1e-9
        hessian = (a * curvature[:, None]).T @ a + ridge * len(y) * np.eye(len(w))
        w = w + np.linalg.solve(hessian, a.T @ (y - p) - ridge * len(y) * w)
    return w


def main():
    rows = np.vstack([np.loadtxt(path, delimiter=",") for path in sys.argv[1:]])
    y, reach, x = rows[:, 0], rows[:, 1], rows[:, 4:]
    mean, scale = x.mean(0), x.std(0) + 1e-9
    a = design((x - mean) / scale)
    w = fit(a, y)
    n = x.shape[1]
    parts = {
        "kMean": mean,
        "kScale": scale,
        "kLinear": w[1 : 1 + n],
        "kSquare": w[1 + n : 1 + 2 * n],
        "kWithFirst": np.concatenate([[0], w[1 + 2 * n : 3 * n]]),
        "kWithLast": np.concatenate([[0], w[3 * n :], [0]]),
    }
    print(f"constexpr double kBias = {w[0]:.4g};")
    for name, values in parts.items():
        print(f"constexpr StemTraits {name} = {{{', '.join(f'{v:.4g}' for v in values)}}};")
    p = 1.0 / (1.0 + np.exp(-a @ w))
    for low, high in ((0, 15), (15, 25), (25, 40)):
        k = (reach >= low) & (reach < high)
        taken = k & (p > 0.5)
        print(
            f"{low}-{high} m: {int(y[k].sum())} stems of {int(k.sum())} chains, "
            f"precision {y[taken].mean():.3f}, recall {y[taken].sum() / y[k].sum():.3f}",
            file=sys.stderr,
        )


if __name__ == "__main__":
    main()
