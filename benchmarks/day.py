"""`./run accuracy --day`: a working day in bounded memory. Python standard library only.

  ./run accuracy --day                      8 hours of the round of evo3, by all points, and 8 hours of a loop in the
                                            stand of lieksa2, by stems
  ./run accuracy --day --hours 0.5          half an hour of each
  ./run accuracy --day --rows stems         one of them: dense, stems
  ./run accuracy --day --keep DIR           keeps the runs; one that was killed goes on where it stopped

The carrier goes the same round again and again (`carrier.rounds`); its motion, the noise of the sensors and the stamps go
on. Memory is that of the whole process, simulator included. Of a run that was resumed the ratio of memory says nothing,
as the part before its half ran in another process. Exit status 1 where a floor is missed.
"""

import argparse
import json
import math
import sys
import tempfile
import time
from pathlib import Path

from program import DONE, UNTRUSTED, Failed, PROGRAM, machine, run, say, simulated, version

FLOOR = 1.1  # of memory at the end over that at half, and of time a scan in the last tenth over the first
# A round takes at least so many seconds; options of `map`; keys of the site.
ROWS = {
    "dense": ("evo3", 1000, [], {}),
    "stems": ("lieksa2", 400, ["--front-end", "sparse"],
              {"carrier.route": "loop", "carrier.work": "quick", "carrier.one_way": "false"}),
}


def recording(row, hours, seed):
    site, round_s, _, keys = ROWS[row]
    rounds = math.ceil(3600 * hours / round_s) + 1
    return simulated(site, seed=seed, duration_s=f"{3600 * hours:g}", **{"carrier.rounds": rounds}, **keys)


def measured(row, hours, seed, threads, folder):
    """run.json of the run, with the kernel's figures and whether it was resumed."""
    unfinished = (folder / ".understory").exists() and not (folder / "run.json").exists()
    words = ["--resume", folder] if unfinished else \
        [recording(row, hours, seed), "-o", folder, "--overwrite", "--threads", threads, *ROWS[row][2]]
    say(f"{row}: {'goes on in ' + str(folder) if unfinished else words[0]}")
    done = run(PROGRAM, "--quiet", "map", *words)
    if done.code not in (DONE, UNTRUSTED):
        raise Failed(f"{row}: exit code {done.code}: {done.stderr.strip()[-800:]}")
    result = json.loads((folder / "run.json").read_text())
    result["resumed"] = unfinished
    result["process"] = {"cpu_s": done.cpu_s, "peak_memory_mb": result["peak_memory_mb"]}
    return result


def figures(result):
    """Memory at half, end, end / half; milliseconds of CPU a scan by tenth, last / first."""
    quality, tenths = result["quality"], result["stages"]["scan"].get("cpu_ms_by_tenth", [])
    half, end = quality.get("memory_mb_half"), quality.get("memory_mb_end")
    ratio = end / half if half and end and not result["resumed"] else None
    # The carrier stands still at the beginning: the second tenth is the first that is like the others.
    slower = tenths[-1] / tenths[1] if len(tenths) == 10 and tenths[1] > 0 else None
    return half, end, ratio, tenths, slower


def shown(value, decimals):
    return "not measured" if value is None else f"{value:.{decimals}f}"


def row_of(row, hours, seed, result):
    half, end, ratio, tenths, slower = figures(result)
    cells = [row, f"{hours:g}", seed, result["scans"], shown(half, 0), shown(end, 0), shown(ratio, 2),
             shown(result["process"]["peak_memory_mb"], 0), " ".join(f"{t:.1f}" for t in tenths), shown(slower, 2),
             result["status"]]
    return "| " + " | ".join(map(str, cells)) + " |"


def missed(row, result):
    _, _, ratio, _, slower = figures(result)
    named = {"memory at the end / at half": ratio, "CPU a scan, last tenth / second": slower}
    return [f"{row}: {name} is {value:.2f}, above {FLOOR}" for name, value in named.items()
            if value is not None and value > FLOOR]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=8.0, help="of recording (default 8)")
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=list(ROWS))
    parser.add_argument("--seed", type=int, default=21)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="folder of the runs; what is unfinished there goes on")
    options = parser.parse_args()
    if not 0.0 < options.hours <= 24.0:
        parser.error("--hours: expected more than 0 and at most 24")
    return options


def measure(options, work):
    lines = [f"{version()}, {time.strftime('%Y-%m-%d')}, {machine()}", "",
             "| row | hours | seed | scans | memory at half MB | at the end MB | end / half | peak MB | CPU ms a scan, by tenth "
             "| last / second | status |", "|---" * 11 + "|"]
    problems = []
    for row in options.rows:
        try:
            result = measured(row, options.hours, options.seed, options.threads, work / f"{row}_{options.hours:g}h")
        except Failed as error:
            problems.append(str(error))
            continue
        lines.append(row_of(row, options.hours, options.seed, result))
        problems += missed(row, result)
    print("\n".join(lines))
    for problem in problems:
        say(problem)
    return 1 if problems else 0


def main():
    options = arguments()
    if options.keep:
        options.keep.mkdir(parents=True, exist_ok=True)
        return measure(options, options.keep)
    with tempfile.TemporaryDirectory(prefix="understory-day-") as scratch:
        return measure(options, Path(scratch))


if __name__ == "__main__":
    sys.exit(main())
