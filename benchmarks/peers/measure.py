"""CPU and wall time of a peer's work on each scan, without the reading around it."""

import json
import resource
import time


def cpu_seconds():
    """User and system time of all threads of this process."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


class Meter:
    def __init__(self):
        self.wall_ms = []
        self.cpu_ms = []

    def __enter__(self):
        self._wall, self._cpu = time.perf_counter(), cpu_seconds()
        return self

    def __exit__(self, *_):
        self.cpu_ms.append(1e3 * (cpu_seconds() - self._cpu))
        self.wall_ms.append(1e3 * (time.perf_counter() - self._wall))

    def summary(self, **more):
        def spread(values):
            ordered = sorted(values)
            return {"mean": sum(ordered) / len(ordered), "p50": ordered[len(ordered) // 2],
                    "p99": ordered[min(len(ordered) - 1, int(0.99 * len(ordered)))],
                    "max": ordered[-1]}
        return {"scans": len(self.cpu_ms), "wall_ms": spread(self.wall_ms),
                "cpu_ms": spread(self.cpu_ms), "cpu_ms_each": self.cpu_ms,
                "peak_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6,
                **more}


def report(path, summary):
    with open(path, "w") as out:
        json.dump(summary, out)
