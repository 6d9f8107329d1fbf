"""Every kind of warning that the sources know is explained in docs/reference/troubleshooting.md."""

import pathlib
import re

TOP = pathlib.Path(__file__).resolve().parents[2]
explained = (TOP / "docs" / "reference" / "troubleshooting.md").read_text()
keys = set()
for path in sorted((TOP / "src").rglob("*.cc")):
    if path.name.endswith("_test.cc"):
        continue
    text = path.read_text()
    for call in re.finditer(r"\b(?:warn|damaged)\(([^;]{0,120})", text):
        keys.update(re.findall(r'"([a-z]+\.[a-z]+(?:_[a-z]+)*)"', call.group(1)))
findings = (TOP / "src" / "understory" / "recording" / "finding.cc").read_text()
keys.update(re.findall(r'return "([a-z]+\.[a-z_]+)";', findings))
assert len(keys) > 45, len(keys)
missing = [key for key in sorted(keys) if key not in explained]
assert not missing, f"not explained: {missing}"
print(len(keys), "kinds of warnings, all explained")
