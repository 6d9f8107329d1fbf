#!/usr/bin/env bash
# tidy.sh BASE: clang-tidy on the .cc files that differ from the commit BASE; "all" takes every file.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
cd "$top"
base=$1
if [[ $base == all ]]; then
  mapfile -t files < <(git ls-files -- 'src/*.cc')
else
  mapfile -t files < <(git diff --name-only --diff-filter=d "$base" -- 'src/*.cc')
fi
if ((${#files[@]} == 0)); then
  say "no changed files"
  exit
fi
# Only files that the build knows have compile commands.
mkdir -p build-tidy
cmake --preset tidy >build-tidy/configure.log 2>&1 || { tail -n 20 build-tidy/configure.log >&2; exit 1; }
mapfile -t known < <(python3 -c 'import json, os, sys
for entry in json.load(open("build-tidy/compile_commands.json")):
    print(os.path.relpath(entry["file"]))')
mapfile -t files < <(comm -12 <(printf '%s\n' "${files[@]}" | sort -u) <(printf '%s\n' "${known[@]}" | sort -u))
printf '%s\0' "${files[@]}" |
  xargs -0 -r -n 2 -P "$(nproc)" clang-tidy -p build-tidy --quiet --warnings-as-errors='*' 2>/dev/null
