"""On a processor without the instructions that it was built for, the program says so and ends with 126, whatever the
command. On one that has them, and on the oldest where it is built for all, it runs."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
emulator = shutil.which("qemu-x86_64")
if not emulator or os.uname().machine != "x86_64":
    print("skipped: needs qemu-x86_64 (qemu-user)")
    sys.exit(77)
cache = (Path(os.environ["UNDERSTORY_BUILD"]) / "CMakeCache.txt").read_text()
level = re.search(r"^UNDERSTORY_MARCH:STRING=(.*)$", cache, re.M)[1]


def on(processor, *words):
    done = subprocess.run([emulator, "-cpu", processor, PROGRAM, *words], capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


if level == "x86-64-v3":
    for words in (["--version"], ["map", "no such recording", "-o", "run"], []):
        code, out, said = on("Nehalem", *words)
        assert code == 126 and not out, (words, code, out, said)
        assert re.search(r"error: .* level x86-64-v3, and this one lacks AVX2, FMA, .*\./run build", said), said
    # One is enough: Sandy Bridge lacks some, and Haswell none.
    code, _, said = on("Haswell,-fma", "--version")
    assert code == 126 and "lacks FMA;" in said, (code, said)
oldest = "Haswell" if level == "x86-64-v3" else "qemu64" if level == "" else "max"
code, out, said = on(oldest, "--version")
assert code == 0 and re.match(r"\d+\.\d+\.\d+$", out.strip()), (level, code, out, said)
print(f"built for {level or 'all processors'}")
