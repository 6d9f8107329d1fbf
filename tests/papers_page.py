"""docs/method/papers.md names what is there: each file, test and key of the configuration in it exists. A row
says what is missing where its state says that something is, and only there. A built row names a test."""

import os
import re
import subprocess
from pathlib import Path

top = Path(__file__).resolve().parent.parent
program = os.environ["UNDERSTORY_PROGRAM"]
page = (top / "docs" / "method" / "papers.md").read_text()
named = set(re.findall(r"`([^`\n]+)`", page))

tests = set()
for path in (top / "src").rglob("*_test.cc"):
    tests |= {".".join(pair) for pair in
              re.findall(r"^TEST(?:_F|_P)?\(\s*(\w+),\s*(\w+)\)", path.read_text(), re.M)}


def keys(*options):
    """Full keys, and the values that one may have, as --print-config tells them."""
    printed = subprocess.run([program, *options, "--print-config"], capture_output=True, text=True, check=True)
    path, full = [], {}
    for line in printed.stdout.splitlines():
        found = re.match(r"( *)(\w+):(.*)", line)
        path = path[:len(found[1]) // 2] + [found[2]]
        full[".".join(path)] = found[3]
    return full


known = {}
for command in (["map"], ["map", "--front-end", "sparse"], ["correct"], ["register"]):
    known |= keys(*command)

wrong = []
for name in sorted(named):
    if re.fullmatch(r"[A-Z]\w+\.[A-Z]\w+", name):
        wrong += [] if name in tests else [f"no test {name}"]
    elif re.fullmatch(r"[\w/]+\.(h|cc|py|svg)", name):
        places = (top, top / "src/understory", top / "src/understory/registration", top / "tests")
        wrong += [] if any((place / name).exists() for place in places) else [f"no file {name}"]
    elif found := re.fullmatch(r"([a-z]\w*(?:\.\w+)+?)(\.\*|_\*)?(?:=([\w.]+))?", name):
        if re.search(r"\.(csv|json|gpkg|laz|tif|html)$", name):
            continue
        stem, rest, value = found.groups()
        fits = [k for k in known if (k.startswith(stem) if rest else k == stem)]
        if not fits:
            wrong.append(f"no key {name}")
        elif value and not re.search(rf"\b{value}\b", known[fits[0]]) and re.search(r"\|", known[fits[0]]):
            wrong.append(f"{stem} has no value {value}: {known[fits[0]].strip()}")

# What a row calls missing is what its state says.
rows = re.findall(r"^\| ((?:P\d|B)-\d+) [^|]*\| ([^|]*) \|[^|]*\|([^|]*)\|([^|]*)\|$", page, re.M)
assert len(rows) == len(re.findall(r"^\| (?:P\d|B)-\d", page, re.M)) == 64, len(rows)
for row, state, notes, shown_by in rows:
    if not re.match(r"built\b|part$|not built$", state):
        wrong.append(f"{row}: no state {state}")
    if state.startswith("built") == ("*Missing*:" in notes):
        wrong.append(f"{row}: {state}, but its notes say {'' if '*Missing*:' in notes else 'not '}what is missing")
    if state.startswith("built") and "`" not in shown_by:
        wrong.append(f"{row}: built, but no test is named")
assert not wrong, "\n".join(wrong)
print(f"{len(named)} names looked up in {len(rows)} rows")
