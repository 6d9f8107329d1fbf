"""How figures look, and what is kept of what they show. A Sheet draws and notes every value that it draws."""

import csv
import gzip
from dataclasses import dataclass, field

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

LARGE = 100_000  # rows of a table beyond which it is compressed
# Okabe and Ito's colours, which the colour-blind tell apart; one for each thing that is shown.
COLOURS = {"truth": "#000000", "ours": "#0072B2", "second": "#D55E00", "third": "#009E73", "fourth": "#CC79A7",
           "fixes": "#E69F00", "trees": "#B5B5B5", "faint": "#999999"}

plt.rcParams.update({"font.size": 9, "axes.titlesize": 9, "axes.grid": True, "grid.color": "#e4e4e4",
                     "grid.linewidth": 0.6, "axes.axisbelow": True, "legend.fontsize": 8, "legend.framealpha": 0.9,
                     "figure.dpi": 110, "savefig.dpi": 110, "lines.linewidth": 1.3, "figure.titlesize": 10})


@dataclass
class Drawn:
    """A figure with its words: what the paper's shows, what ours shows, and the numbers behind it."""

    sheet: "Sheet"
    paper: str
    ours: str
    numbers: list  # (quantity, ours, the paper's or "")


@dataclass
class Sheet:
    """One figure of `rows` x `columns` axes. Each drawing method takes an axes, and a name for legend and table."""

    title: str
    rows: int = 1
    columns: int = 1
    size: tuple = (7.5, 4.2)
    layout: dict = field(default_factory=dict)
    values: list = field(default_factory=list)

    def __post_init__(self):
        self.figure, self.axes = plt.subplots(self.rows, self.columns, figsize=self.size, squeeze=False,
                                              layout="constrained", **self.layout)
        self.figure.get_layout_engine().set(w_pad=0.12, h_pad=0.06)
        self.figure.suptitle(self.title)

    def name(self, axes, title="", x="", y=""):
        axes.set_title(title)
        axes.set_xlabel(x)
        axes.set_ylabel(y)

    def _note(self, axes, series, *columns):
        self.values.append((axes, series, [np.asarray(c, float).ravel() for c in columns]))

    def line(self, axes, series, x, y, colour, **style):
        self._note(axes, series, x, y)
        axes.plot(x, y, label=series, color=COLOURS.get(colour, colour), **style)

    def dots(self, axes, series, x, y, colour, size=8, **style):
        self._note(axes, series, x, y)
        axes.scatter(x, y, s=size, label=series, color=COLOURS.get(colour, colour), linewidths=0, **style)

    def bars(self, axes, series, x, heights, width, colour, **style):
        self._note(axes, series, x, heights)
        axes.bar(x, heights, width=width, label=series, color=COLOURS.get(colour, colour), **style)

    def raster(self, axes, series, cells, extent, **style):
        """An image: `cells` (rows from low to high y, columns), NaN empty; `extent`: x0, x1, y0, y1."""
        height, width = cells.shape
        x = extent[0] + (np.arange(width) + 0.5) * (extent[1] - extent[0]) / width
        y = extent[2] + (np.arange(height) + 0.5) * (extent[3] - extent[2]) / height
        rows, columns = np.nonzero(np.isfinite(cells))
        self._note(axes, series, x[columns], y[rows], cells[rows, columns])
        return axes.imshow(cells, origin="lower", extent=extent, aspect="equal", interpolation="nearest", **style)

    def legend(self, axes, **style):
        axes.legend(**style)

    def is_empty(self):
        return not any(np.isfinite(column).any() for _, _, columns in self.values for column in columns)

    def save(self, folder, key):
        """KEY.png and KEY.csv (beyond LARGE rows KEY.csv.gz); the paths of both."""
        picture = folder / f"{key}.png"
        self.figure.savefig(picture)
        names = {axes: axes.get_title().replace("\n", " ") or f"axes {i + 1}"
                 for i, axes in enumerate(self.figure.axes)}
        count = sum(len(columns[0]) for _, _, columns in self.values)
        table = folder / f"{key}.csv{'.gz' if count > LARGE else ''}"
        for old in (folder / f"{key}.csv", folder / f"{key}.csv.gz"):
            old.unlink(missing_ok=True)
        with (gzip.open if count > LARGE else open)(table, "wt", newline="", encoding="utf-8") as text:
            writer = csv.writer(text)
            writer.writerow(["axes", "series", "x_is", "y_is", "x", "y", "value"])
            for axes, series, columns in self.values:
                head = [names[axes], series, axes.get_xlabel(), axes.get_ylabel()]
                for row in zip(*columns):
                    writer.writerow(head + [f"{value:.10g}" for value in row] + [""] * (3 - len(row)))
        plt.close(self.figure)
        return picture, table


def cells_of(points, extent, cell_m, how="highest"):
    """Points (n, 3) as a raster: `highest` z of each cell, or `count`. Empty cells are NaN."""
    width = max(1, int(round((extent[1] - extent[0]) / cell_m)))
    height = max(1, int(round((extent[3] - extent[2]) / cell_m)))
    column = np.floor((points[:, 0] - extent[0]) / cell_m).astype(int)
    row = np.floor((points[:, 1] - extent[2]) / cell_m).astype(int)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    index = row[inside] * width + column[inside]
    if how == "count":
        cells = np.bincount(index, minlength=width * height).astype(float)
        cells[cells == 0] = np.nan
    else:
        cells = np.full(width * height, -np.inf)
        np.maximum.at(cells, index, points[inside, 2])
        cells[np.isinf(cells)] = np.nan
    return cells.reshape(height, width)


def shown_part(points, margin=3.0, share=0.002):
    """x0, x1, y0, y1 around all but a share of points at each side, for the limits of a map."""
    low, high = np.quantile(points[:, :2], [share, 1 - share], axis=0)
    return [low[0] - margin, high[0] + margin, low[1] - margin, high[1] + margin]
