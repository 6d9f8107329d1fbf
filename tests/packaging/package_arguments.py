"""./run package refuses words that it does not know before it builds anything, and the trial refuses what is no package."""

import subprocess
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]


def refused(code, said, *words):
    done = subprocess.run([str(word) for word in words], cwd=TOP, capture_output=True, text=True, timeout=60)
    assert done.returncode == code and said in done.stderr, (words, done.returncode, done.stdout, done.stderr)


refused(1, "Debian 12 and 13, not for '11'", "./run", "package", "--debian", "11")
refused(1, "not for '../x'", "./run", "package", "--debian", "../x")
refused(2, "--no-trial", "./run", "package", "--debian")
refused(2, "--no-trial", "./run", "package", "--march")
refused(2, "--no-trial", "./run", "package", "everything")
refused(1, "x86-64-v9", "./run", "package", "--march", "x86-64-v9", "--no-trial")
refused(2, "FILE", "tools/try-package.sh")
refused(1, "no.deb is not there", "tools/try-package.sh", "no.deb")
with tempfile.TemporaryDirectory() as folder:
    unnamed = Path(folder) / "other.deb"
    unnamed.write_text("no package")
    refused(1, "is no package of Understory", "tools/try-package.sh", unnamed)
print("refused")
