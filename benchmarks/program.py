"""Runs the program for the benchmarks and reads what it wrote. Python standard library only."""

import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent
PROGRAM = Path(os.environ.get("UNDERSTORY_PROGRAM", TOP / "build" / "understory"))

# Exit codes: done; done, but partial or not to be trusted.
DONE, UNTRUSTED = 0, 4


class Failed(Exception):
    pass


@dataclass
class Finished:
    code: int
    wall_s: float
    cpu_s: float
    peak_memory_mb: float
    stdout: str
    stderr: str = field(repr=False, default="")


def run(*arguments, cpus=None):
    """Runs a command; its CPU time and memory are the kernel's figures for that process. The kernel's peak of memory
    begins with that of the process that starts it: no peak is told where this process had as much."""
    command = [str(a) for a in arguments]
    begin = time.perf_counter()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          preexec_fn=(lambda: os.sched_setaffinity(0, cpus)) if cpus else None,
                          ) as process:
        # Standard error is short (--quiet), so reading one after the other cannot block.
        out, err = process.stdout.read(), process.stderr.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    own_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    peak_mb = usage.ru_maxrss * 1024 / 1e6 if usage.ru_maxrss > own_kib else float("nan")
    return Finished(process.returncode, time.perf_counter() - begin, usage.ru_utime + usage.ru_stime, peak_mb, out, err)


def understory(*arguments, accept=(DONE,), cpus=None):
    done = run(PROGRAM, "--quiet", *arguments, cpus=cpus)
    if done.code not in accept:
        raise Failed(f"understory {' '.join(map(str, arguments))}\n"
                     f"ended with exit code {done.code}: {done.stderr.strip()[-800:]}")
    return done


def understory_json(*arguments):
    return json.loads(understory(*arguments, "--json", accept=(DONE, UNTRUSTED)).stdout)


def simulated(site, **keys):
    """The name of a simulated recording: sim:SITE?key=value&..."""
    return f"sim:{site}?" + "&".join(f"{k}={v}" for k, v in keys.items())


def map_recording(recording, folder, threads=2, settings=(), cpus=None, more=()):
    """Maps a recording; returns its run.json with the kernel's CPU time, and the program's own peak of memory, under
    'process'."""
    arguments = ["map", recording, "-o", folder, "--threads", threads, "--overwrite", *more]
    for setting in settings:
        arguments += ["--set", setting]
    done = understory(*arguments, accept=(DONE, UNTRUSTED), cpus=cpus)
    result = json.loads((Path(folder) / "run.json").read_text())
    result["process"] = {"cpu_s": done.cpu_s, "wall_s": done.wall_s,
                         "peak_memory_mb": result["peak_memory_mb"]}
    return result


def truth_of(folder):
    return f"{folder}.truth"


def version():
    return run(PROGRAM, "--version").stdout.strip()


def digest():
    """What tells one build of the program from another where the version is the same."""
    return hashlib.sha256(PROGRAM.read_bytes()).hexdigest()[:12]


class KeptRows:
    """The rows of a table in a folder, so that a command that was stopped goes on where it was. Each
    has the program's digest in its key. Without a folder they are kept in one of their own."""

    def __init__(self, folder, name):
        self.folder = Path(folder or tempfile.mkdtemp(prefix=f"understory-{name}-"))
        self.folder.mkdir(parents=True, exist_ok=True)
        self.file = self.folder / "rows.jsonl"
        lines = self.file.read_text().splitlines() if self.file.exists() else []
        self.rows = {row["key"]: row for row in map(json.loads, lines)}

    def get(self, key, make):
        key = f"{digest()} {key}"
        if key not in self.rows:
            self.rows[key] = make() | {"key": key}
            with open(self.file, "a", encoding="utf-8") as to:
                to.write(json.dumps(self.rows[key]) + "\n")
        return self.rows[key]


def machine():
    """The processor and how much of it there is, for the head of a table of times."""
    name = "unknown processor"
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                name = line.split(":", 1)[1].strip()
                break
    except OSError:
        pass
    return f"{name}, {os.cpu_count()} threads, load {os.getloadavg()[0]:.1f}"


def say(text):
    print(text, file=sys.stderr, flush=True)


def own_cpus(count=2):
    """The first `count` processors that this process may use."""
    return set(sorted(os.sched_getaffinity(0))[:count])


