#!/usr/bin/env python3
"""`./run accuracy --figures`: the figures of the papers, drawn from runs of ours on simulated recordings.

  ./run accuracy --figures -o DIR               all of them, from whole recordings: many hours on two processors
  ./run accuracy --figures -o DIR --short       the first 20 s of each recording: minutes
  ./run accuracy --figures -o DIR --seconds 90  the first 90 s of each
  ./run accuracy --figures -o DIR --only P2-F4,P4-F21
  ./run accuracy --figures --list               which figures there are, and what each needs
  ./run accuracy --figures -o DIR --write       also puts page and pictures into docs/method and docs/pictures; figures
                                                that are not in DIR stay there as they are

DIR then holds index.html (all figures with their words), and of each figure KEY.png, KEY.csv (the values that are
drawn) and KEY.json (its words). Runs lie in DIR/runs. A finished run is not made again, so a stopped command goes on
where it was. Recordings are simulated once for all runs that need them, and removed then."""

import argparse
import sys
from pathlib import Path

from PIL import Image

from figures.catalogue import all_figures
from figures.page import Entry, entries_in, markdown, save_entry, write_html
from figures.paper_figure import Plan
from figures.runs import SHORT_S, Runs
from program import TOP, Failed, say

DEFAULT_SEED = 3  # settings are tuned on seeds up to 19
PAGE = TOP / "docs" / "method" / "figures.md"
PICTURES = TOP / "docs" / "pictures" / "figures"


def chosen_figures(text):
    figures = all_figures()
    keys = [key.strip() for key in text.split(",")] if text else list(figures)
    unknown = [key for key in keys if key not in figures]
    if unknown:
        raise argparse.ArgumentTypeError(f"unknown figure: {', '.join(unknown)}; there are {', '.join(figures)}")
    return [figures[key] for key in figures if key in keys]


def positive(text):
    value = float(text)
    if not 1 <= value < 1e6:
        raise argparse.ArgumentTypeError("expected 1 to 1,000,000 seconds")
    return value


def setting(text):
    key, equals, value = text.partition("=")
    if not key or not equals or not value:
        raise argparse.ArgumentTypeError("expected KEY=VALUE")
    return key, value


def arguments(words):
    parser = argparse.ArgumentParser(prog="./run accuracy --figures", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("figures"), metavar="DIR")
    parser.add_argument("--only", type=chosen_figures, default="", metavar="P2-F4,...")
    parser.add_argument("--seed", type=int, default=DEFAULT_SEED)
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--short", action="store_true", help=f"the first {SHORT_S:g} s of each recording")
    length.add_argument("--seconds", type=positive, metavar="S", help="the first S seconds of each recording")
    parser.add_argument("--set", action="append", default=[], type=setting, metavar="KEY=VALUE",
                        help="a setting of all sites, e.g. lidar.columns=512")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--list", action="store_true", help="which figures there are")
    parser.add_argument("--write", action="store_true", help=f"put page and pictures into {PAGE.parent}")
    options = parser.parse_args(words)
    if options.seed < 1 or options.threads < 1:
        parser.error("--seed and --threads are 1 or more")
    return options


def says_of(jobs):
    """The recordings of some jobs in words, each once."""
    return "; ".join(dict.fromkeys(job.recording.says for job in jobs.values()))


def draw(figure, plan, runs, folder):
    """Draws a figure into the folder; returns why not, if it could not."""
    jobs = figure.jobs(plan)
    made = {name: runs.get(job) for name, job in jobs.items()}
    if made and all(run.failed for run in made.values()):
        return "none of its runs gave a result: " + next(iter(made.values())).failed
    try:
        drawn = figure.draw(plan, f"{figure.key}: {figure.title}", made)
    except (Failed, ValueError, KeyError, StopIteration) as error:
        return f"{type(error).__name__}: {error}"
    if drawn.sheet.is_empty():
        return "nothing to draw"
    picture, table = drawn.sheet.save(folder, figure.key)
    recordings = says_of(jobs) or drawn.sheet.title.splitlines()[-1]
    save_entry(folder, Entry(figure.key, figure.title, recordings, drawn.paper, drawn.ours, drawn.numbers,
                             picture.name, table.name))
    return ""


def write_docs(folder, entries):
    PICTURES.mkdir(parents=True, exist_ok=True)
    for entry in entries:  # of few colours: a third of the bytes, and no difference to the eye
        picture = Image.open(folder / entry.picture).convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE)
        picture.save(PICTURES / entry.picture, optimize=True)
    old = PAGE.read_text() if PAGE.exists() else ""
    PAGE.write_text(markdown(entries, f"../pictures/{PICTURES.name}", all_figures(), old))
    say(f"written: {PAGE}")


def main(words=None):
    options = arguments(words)
    plan = Plan(options.seed, SHORT_S if options.short else options.seconds, options.output,
                tuple(options.set))
    if options.list:
        for figure in options.only:
            print(f"{figure.key:8} {figure.title}: {says_of(figure.jobs(plan)) or 'a run of its own'}")
        return 0
    try:
        runs = Runs(options.output, options.threads)
        runs.make(job for figure in options.only for job in figure.jobs(plan).values())
    except OSError as error:
        say(f"{options.output}: cannot be written: {error.strerror}")
        return 3
    except Failed as error:  # a recording could not be simulated: a wrong key of --set, or a full disk
        say(str(error))
        return 3
    missing = {}
    for figure in options.only:
        say(figure.key)
        reason = draw(figure, plan, runs, options.output)
        if reason:
            missing[figure.key] = reason
    entries = entries_in(options.output, all_figures())
    write_html(options.output, entries)
    for key, reason in missing.items():
        say(f"{key} is not drawn: {reason}")
    if options.write:
        write_docs(options.output, entries)
    say(f"{len(entries)} figures: {options.output / 'index.html'}")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
