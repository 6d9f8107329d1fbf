"""Runs that figures are drawn from. Each is made once in a folder; a finished run is taken as it is.

A recording is simulated once for all runs that need it, and removed when they are done. Recordings are
large, and the same seed gives the same bytes again. Its truth stays."""

import json
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from program import DONE, UNTRUSTED, Failed, say, understory, understory_json, version

SHORT_S = 20.0  # of a recording in the short form


@dataclass(frozen=True)
class Recording:
    """A simulated recording. `seconds`: only its beginning; None: whole. `keys`: ((key, value), ...) of the site."""

    site: str
    seed: int
    seconds: float | None = None
    keys: tuple = ()
    short: str = ""  # a word for what `keys` change, for names of folders

    @property
    def name(self):
        part = "whole" if self.seconds is None else f"{self.seconds:g}s"
        return "_".join(word for word in (self.site, self.short, f"seed{self.seed}", part) if word)

    @property
    def says(self):
        part = "whole" if self.seconds is None else f"first {self.seconds:g} s"
        changed = "".join(f", {key} {value}" for key, value in self.keys)
        return f"{self.site}, seed {self.seed}, {part}{changed}"


@dataclass(frozen=True)
class Job:
    """One mapping run of a recording; `arguments` are those of `understory map`."""

    recording: Recording
    way: str
    arguments: tuple = ()

    @property
    def name(self):
        return f"{self.recording.name}_{self.way}"


def reason_of(error):
    """The last line of a failure, without the folders of this machine."""
    return re.sub(r"/\S*/", "", str(error).splitlines()[-1].split("error: ")[-1]).strip()


def settings(*pairs):
    """The arguments that set these keys."""
    return tuple(word for pair in pairs for word in ("--set", pair))


class Run:
    """A finished run: its folder, its truth, and what its run.json says. `failed`: why there is no result."""

    def __init__(self, job, folder, truth):
        self.job, self.folder, self.truth = job, Path(folder), Path(truth)
        result = self.folder / "run.json"
        self.failed = "" if result.exists() else (self.folder.with_suffix(".failed").read_text()
                                                  if self.folder.with_suffix(".failed").exists() else "no run.json")
        self.told = json.loads(result.read_text()) if result.exists() else {}

    def errors(self, alignment="se3", path="trajectory.tum"):
        """What `understory evaluate` says of a path of the run."""
        estimate = self.folder if path == "trajectory.tum" else self.folder / path
        return understory_json("evaluate", estimate, self.truth, "--align", alignment)


class Runs:
    """Makes the runs of a folder and hands them out."""

    def __init__(self, folder, threads=2):
        self.folder, self.threads = Path(folder), threads
        for name in ("runs", "recordings"):
            (self.folder / name).mkdir(parents=True, exist_ok=True)

    def _paths(self, job):
        return self.folder / "runs" / job.name, self.folder / "recordings" / f"{job.recording.name}.mcap"

    def _order(self, job):
        """What a run is made of: where it differs, the run is made again."""
        recording = job.recording
        return {"recording": [recording.site, recording.seed, recording.seconds, list(map(list, recording.keys))],
                "arguments": list(job.arguments), "version": version()}

    def is_done(self, job):
        run, _ = self._paths(job)
        order = run.with_suffix(".order.json")
        made = (run / "run.json").exists() or run.with_suffix(".failed").exists()
        return made and order.exists() and json.loads(order.read_text()) == self._order(job)

    def make(self, jobs):
        """Makes the runs that are not there yet, recording by recording."""
        wanted = [job for job in dict.fromkeys(jobs) if not self.is_done(job)]
        by_recording = {}
        for job in wanted:
            by_recording.setdefault(job.recording, []).append(job)
        for done, (recording, its_jobs) in enumerate(by_recording.items(), 1):
            say(f"recording {done} of {len(by_recording)}: {recording.says}, {len(its_jobs)} runs")
            file = self._simulate(recording)
            for job in its_jobs:
                say(f"  {job.way}")
                self._map(job, file)
            file.unlink()

    def _simulate(self, recording):
        file = self.folder / "recordings" / f"{recording.name}.mcap"
        arguments = ["simulate", recording.site, "-o", file, "--seed", recording.seed, "--overwrite"]
        if recording.seconds is not None:
            arguments += ["--duration-s", recording.seconds]
        for key, value in recording.keys:
            arguments += ["--set", f"{key}={value}"]
        understory(*arguments)
        return file

    def _map(self, job, file):
        run, _ = self._paths(job)
        for old in (run.with_suffix(".order.json"), run.with_suffix(".failed")):
            old.unlink(missing_ok=True)
        shutil.rmtree(run, ignore_errors=True)
        try:
            understory("map", file, "-o", run, "--threads", self.threads, *job.arguments, accept=(DONE, UNTRUSTED))
        except Failed as error:
            say(f"    {error}")
            run.with_suffix(".failed").write_text(reason_of(error))
        run.with_suffix(".order.json").write_text(json.dumps(self._order(job)))

    def get(self, job):
        run, file = self._paths(job)
        return Run(job, run, file.with_suffix(".truth"))
