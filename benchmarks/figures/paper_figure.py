"""What a figure of a paper is, and the plan that it is drawn by."""

from dataclasses import dataclass
from pathlib import Path
from typing import Callable

from figures.runs import Recording


@dataclass(frozen=True)
class Plan:
    """Which recordings the figures are drawn from. `seconds`: of each only so much; None: whole."""

    seed: int
    seconds: float | None = None
    folder: Path = Path("figures")
    keys: tuple = ()  # ((key, value), ...) of every site, e.g. a lidar with fewer columns

    def recording(self, site, keys=(), short=""):
        """`short`: a word for `keys`, which are this figure's own."""
        return Recording(site, self.seed, self.seconds, (*keys, *self.keys), short)


@dataclass(frozen=True)
class PaperFigure:
    key: str  # P2-F4
    title: str
    jobs: Callable  # Plan -> {name: Job}
    draw: Callable  # Plan, title, {name: Run} -> Drawn
