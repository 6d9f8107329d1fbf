"""A disk that becomes full at any point, in the commands that write a folder from other results. The
exit code is 3, the message names the place, and nothing is left behind. Former results stay as they are,
and with room the command works."""

import resource
import subprocess

from program import Cases, good_recording, program, snapshot, two_runs

cases = Cases()
good, messages, truth = good_recording(seconds=8, more=("stand.size_x_m=24", "stand.size_y_m=24"))
RUN, STEMS, FIXES = two_runs(good)
COMMANDS = {
    "inventory": ["inventory", RUN / "map.laz", "--copc"],
    "inventory of a run": ["inventory", RUN, "--set", "extent=basic"],
    "georeference": ["georeference", RUN, "--method", "auto", "--gnss", FIXES],
    "merge": ["merge", RUN, truth / "trees.csv"],
    "correct": ["correct", STEMS / "stems.csv.gz"],
}
STEPS = 3


def refused(words, out, **options):
    done = program(*words, "-o", out, **options)
    if done.returncode in (0, 4):
        return False
    said = done.stderr.strip().splitlines()[-1]
    assert done.returncode == 3 and said.startswith(f"error: {out}"), (done.returncode, done.stderr)
    assert "space" in said or "large" in said or "written" in said, said
    return True


def bytes_of(folder):
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def full_disk(folder, whole, words):
    """A disk with ever less room, and then former results with no room for a second copy."""
    place = folder / "disk"
    place.mkdir()
    needed = bytes_of(whole)
    size = 3 * needed // 1024 + 512  # KiB
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}k", "tmpfs", str(place)]
    if subprocess.run(mount, capture_output=True).returncode != 0:
        return "not tried: nothing can be mounted (see the limit on files)"
    times = 0
    try:
        for step in range(STEPS):
            filled = place / "filled"
            filled.write_bytes(b"0" * (size * 1024 - needed * step // STEPS - 8192))
            before = snapshot(place)
            if not refused(words, place / "out"):
                break
            times += 1
            assert snapshot(place) == before, "something was left on the full disk"
        filled.unlink()
        # Over results of its own, with no room for a second copy.
        done = program(*words, "-o", place / "out", "--overwrite")
        assert done.returncode in (0, 4), done.stderr
        filled.write_bytes(b"0" * max(0, size * 1024 - bytes_of(place / "out") - needed // 2))
        before = snapshot(place)
        over = refused([*words, "--overwrite"], place / "out")
        assert not over or snapshot(place) == before, "former results were touched"
    finally:
        subprocess.run(["umount", str(place)], check=True)
    assert times > 0, "the disk was never full"
    return f"full {times} times, over former results {'too' if over else 'never'}"


def files_that_may_not_grow(folder, whole, words):
    sizes = sorted({path.stat().st_size for path in whole.rglob("*") if path.is_file()})
    before = snapshot(whole)
    for size in (sizes[0], sizes[len(sizes) // 2], sizes[-1]):
        limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size // 2, resource.RLIM_INFINITY))
        assert refused(words, folder / "out", preexec_fn=limit), size
        assert not (folder / "out").exists(), f"left {list((folder / 'out').rglob('*'))}"
        assert refused([*words, "--overwrite"], whole, preexec_fn=limit), size
        assert snapshot(whole) == before, "former results were touched"
    return f"limits of {sizes[0]} to {sizes[-1]} bytes"


for name, command in COMMANDS.items():
    @cases.case(name)
    def tried(folder, words=command):
        whole = folder / "whole"
        assert program(*words, "-o", whole).returncode in (0, 4)
        return "; ".join(way(folder, whole, words) for way in (full_disk, files_that_may_not_grow))


cases.run()
