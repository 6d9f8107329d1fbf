#!/usr/bin/env python3
"""What each number does that is no setting: the tables of constants (`src/understory/*/*_constants.h`).

    ./run bench constants [--header forest/stem_constants.h] [--names KEY ...] [--factors 0.8 1.25]
                          [--only "not recorded"] [--command map|correct] [--words WORDS] [--work FOLDER]
                          RUN TRUTH [RUN TRUTH ...]

The command builds the program once more, in --work, from a copy of the sources. There each number of --header is read
from the environment. Then it measures all pairs with each number times each of --factors. Whole numbers are changed by
one at least. RUN is a folder of `understory map`, TRUTH the one of `understory simulate` beside its recording.

What is measured depends on the header. The layer `forest`: `understory inventory RUN`, compared with the true trees.
Other layers: RUN is a recording, and `understory map RUN --front-end sparse` (`--words`: other ones) is compared with
the true path and the true trees. With `--command correct` RUN is a run by stems, and `understory correct RUN` is compared.
A line tells a figure's change by the number. The first line is that of the program as it is.

A number that the compiler has to know is left out, and named. A key is `file::kName`, as the tables write it."""

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import numpy as np

import inventory_table
import program

SETTING = "UNDERSTORY_CONSTANT"
# A number of a table with its comment, on one line or on two.
NUMBER = re.compile(r"^inline constexpr (double|float|int|std::size_t|std::u?int\d+_t) (k\w+) =\s*([^;]+);", re.M)
READER = """#include <cstdlib>
#include <cstring>
namespace understory::changed_constants {
// The value of NAME=VALUE in the environment if it is of this name, else the usual one.
template <typename Number>
Number value_of(const char* name, Number usual) {
  const char* set = std::getenv("%s");
  const std::size_t length = std::strlen(name);
  if (set == nullptr || std::strncmp(set, name, length) != 0 || set[length] != '=') return usual;
  return static_cast<Number>(std::atof(set + length + 1));
}
}  // namespace understory::changed_constants
""" % SETTING


def names_with_comments(text):
    """(file::name, type, value as written, comment) of each number of a table."""
    found, space, comment, lines = [], "", [], text.splitlines()
    for i, line in enumerate(lines):
        if opened := re.match(r"namespace (\w+) \{", line):
            space = opened.group(1)
        if line.startswith("//"):
            comment.append(line.lstrip("/ "))
            continue
        if number := NUMBER.match("\n".join(lines[i:i + 3])):
            found.append((f"{space}::{number.group(2)}", number.group(1), number.group(3).strip(), " ".join(comment)))
        comment = []
    return found


def changeable(text, fixed):
    """The table with numbers that are read when the program starts, but those of `fixed`."""
    space, out = "", []
    for part in re.split(r"(?m)^(?=namespace )", text):
        if opened := re.match(r"namespace (\w+) \{", part):
            space = opened.group(1)

        def read(match, space=space):
            kind, name, value = match.groups()
            key = f"{space}::{name}"
            if key in fixed:
                return match.group(0)
            return f'inline const {kind} {name} = changed_constants::value_of<{kind}>("{key}", {value});'

        out.append(NUMBER.sub(read, part))
    text = "".join(out)
    return text.replace("#pragma once\n", "#pragma once\n" + READER, 1)


def built(header, work):
    """The program whose numbers of that table can be changed, and the names of those that cannot."""
    tree, top = work / "tree", program.TOP
    tree.mkdir(parents=True, exist_ok=True)
    tracked = subprocess.run(["git", "ls-files", "-z", "src", "cmake", "demo", "configs", "CMakeLists.txt", "CMakePresets.json", "packaging", "tools", "LICENSE", "docs"],
                             cwd=top, capture_output=True, text=True, check=True).stdout.split("\0")
    for name in filter(None, tracked):
        there = tree / name
        there.parent.mkdir(parents=True, exist_ok=True)
        if not there.exists() or there.read_bytes() != (top / name).read_bytes():
            shutil.copy2(top / name, there)
    subprocess.run(["cmake", "--preset", "release", "-DUNDERSTORY_TESTS=OFF", "-DUNDERSTORY_WARNINGS_AS_ERRORS=OFF"],
                   cwd=tree, check=True, stdout=subprocess.DEVNULL)
    text, fixed = (top / "src/understory" / header).read_text(), set()
    keys = {key for key, *_ in names_with_comments(text)}
    while True:
        (tree / "src/understory" / header).write_text(changeable(text, fixed))
        done = subprocess.run(["cmake", "--build", "build", "--parallel", str(os.cpu_count()), "--target", "understory", "--", "-k", "0"],
                              cwd=tree, capture_output=True, text=True)
        if done.returncode == 0:
            return tree / "build" / "understory", fixed
        # GCC names what it had to know while compiling.
        named = set(re.findall(r"‘[\w:]*?(\w+::k\w+)’", done.stdout)) & keys - fixed
        if not named:
            sys.exit(done.stdout[-4000:] + done.stderr[-2000:])
        fixed |= named


def changed_values(kind, value, factors):
    """What a number is set to: it times each factor; whole ones to another whole number."""
    if kind in ("double", "float"):
        return [factor * value for factor in factors]
    return [max(value + 1, round(factor * value)) if factor > 1.0 else min(value - 1, round(factor * value)) for factor in factors]


def value_of(text, names):
    """The number that a table writes, where it is written as one."""
    text = re.sub(r"(?<=[\d.])'(?=\d)", "", text)
    text = re.sub(r"(?<=[\d.])[FfU]\b", "", text).replace("std::numbers::pi", str(np.pi)).replace("kRadPerDegree", str(np.pi / 180))
    if not re.fullmatch(r"[-+*/(). \deE]+", text):
        return None
    return eval(text, {"__builtins__": {}}, names)


def environment(key, value):
    return {**os.environ, **({SETTING: f"{key}={value!r}"} if key else {})}


def inventory_figures(built_program, pairs, key, value, work):
    pool = inventory_table.Pool(False)
    for run, truth in pairs:
        folder = pathlib.Path(tempfile.mkdtemp(dir=work))
        done = subprocess.run([str(built_program), "--quiet", "inventory", run, "-o", str(folder / "i"), "--threads", "1"],
                              capture_output=True, text=True, env=environment(key, value))
        if done.returncode not in (0, 4):
            return None
        pool.add(str(folder / "i"), truth)
        shutil.rmtree(folder)
    figures = {}
    for name, found, expected, false, listed in zip(("big", "thin", "twig"), pool.found, pool.expected, pool.false, pool.listed):
        figures[f"{name} found %"] = 100.0 * found / max(1, expected)
        figures[f"{name} false %"] = 100.0 * false / max(1, listed)
    dbh = np.array(pool.dbh)
    near = dbh[(dbh[:, 0] < 15) & (dbh[:, 3] >= 0.10) & np.isfinite(dbh[:, 1])]
    figures["bias cm"] = 100 * near[:, 1].mean()
    figures["RMSE cm"] = 100 * np.sqrt((near[:, 1] ** 2).mean())
    thin = dbh[(dbh[:, 0] < 15) & (dbh[:, 3] < 0.10) & (dbh[:, 3] >= 0.05) & np.isfinite(dbh[:, 1])]
    figures["thin RMSE cm"] = 100 * np.sqrt((thin[:, 1] ** 2).mean())
    figures["in 1 sd %"] = 100 * np.mean(np.abs(near[:, 1]) < near[:, 2])
    return figures


def evaluated(*words):
    done = subprocess.run([str(program.PROGRAM), "evaluate", *words, "--json"], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def map_figures(built_program, pairs, key, value, work, command, words):
    ape, found, false, dbh = [], [], [], []
    for recording, truth in pairs:
        folder = pathlib.Path(tempfile.mkdtemp(dir=work))
        done = subprocess.run([str(built_program), "--quiet", command, recording, "-o", str(folder / "r"), "--threads", "1", *words],
                              capture_output=True, text=True, env=environment(key, value))
        if done.returncode not in (0, 4):
            return None
        run = str(folder / "r")
        path = evaluated(run, truth, "--align", "se3")
        trees = evaluated("trees", run, truth, "--align", "yaw")
        ape.append(100 * path["ape_rmse_m"])
        found.append(trees["matched"])
        false.append(trees["trees_a"] - trees["matched"])
        dbh.append(np.nan if trees["dbh_rmse_m"] is None else trees["dbh_rmse_m"])
        shutil.rmtree(folder)
    return {"APE cm": float(np.mean(ape)), "worst APE cm": max(ape), "found": sum(found), "false": sum(false),
            "diameter RMSE cm": 100 * float(np.sqrt(np.nanmean(np.square(dbh))))}


def line_of(name, figures, base):
    if figures is None:
        return f"| {name} | failed |"
    cells = [f"{figures[k]:.2f}" if base is None else ("" if abs(figures[k] - base[k]) < 5e-3 else f"{figures[k] - base[k]:+.2f}") for k in figures]
    return f"| {name} | " + " | ".join(cells) + " |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pairs", nargs="+", metavar="RUN TRUTH")
    parser.add_argument("--header", default="forest/stem_constants.h")
    parser.add_argument("--names", nargs="+", default=[])
    parser.add_argument("--factors", nargs="+", type=float, default=[0.8, 1.25])
    parser.add_argument("--only", default="")
    parser.add_argument("--command", choices=("map", "correct"), default="map")
    parser.add_argument("--words")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--work", type=pathlib.Path, default=program.TOP / "out" / "constants")
    args = parser.parse_args()
    if len(args.pairs) % 2:
        parser.error("RUN and TRUTH come in pairs")
    pairs = list(zip(args.pairs[::2], args.pairs[1::2]))
    args.work.mkdir(parents=True, exist_ok=True)
    changed, fixed = built(args.header, args.work)
    inventory_table.PROGRAM = str(program.PROGRAM)

    def measured(key="", value=0.0):
        if args.header.startswith("forest/"):
            return inventory_figures(changed, pairs, key, value, args.work)
        words = args.words if args.words is not None else "--front-end sparse" if args.command == "map" else ""
        return map_figures(changed, pairs, key, value, args.work, args.command, words.split())

    base = measured()
    print("| number, set to | " + " | ".join(base) + " |\n|" + "---|" * (1 + len(base)))
    print(line_of("as it is", base, None), flush=True)
    tasks = []
    for key, kind, text, comment in names_with_comments((program.TOP / "src/understory" / args.header).read_text()):
        if (args.names and key not in args.names) or args.only not in comment:
            continue
        value = value_of(text, {})
        if key in fixed or value is None:
            print(f"| {key} | left out |", flush=True)
            continue
        tasks += [(f"{key} {value:g}: {new:g}", key, new) for new in changed_values(kind, value, args.factors)]
    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        for name, figures in zip((name for name, *_ in tasks), pool.map(lambda task: measured(*task[1:]), tasks)):
            print(line_of(name, figures, base), flush=True)


if __name__ == "__main__":
    main()
