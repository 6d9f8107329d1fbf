#!/usr/bin/env bash
# check.sh [BASE]: what a change has to pass beside the tests: layers, names, functions, docstrings,
# comments and format. clang-tidy looks at the .cc files that differ from BASE (see tidy.sh).
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
cd "$top"
tools/setup.sh check
failed=()

say "layers"
python3 tools/check_layers.py || failed+=(layers)
python3 tools/check_layers_test.py || failed+=("the layers script's own test")
say "names"
python3 tools/check_names.py || failed+=(names)
python3 tools/check_names_test.py || failed+=("the names script's own test")
say "functions"
python3 tools/check_functions.py || failed+=(functions)
python3 tools/check_functions_test.py || failed+=("the functions script's own test")
say "docstrings"
python3 tools/check_docstrings.py || failed+=(docstrings)
python3 tools/check_docstrings_test.py || failed+=("the docstrings script's own test")
say "comments"
python3 tools/check_comments.py || failed+=(comments)
python3 tools/check_comments_test.py || failed+=("the comments script's own test")
say "format"
tools/format.sh --check || failed+=(format)
say "clang-tidy on changed files"
tools/tidy.sh ${1:+"$1"} || failed+=(clang-tidy)

if ((${#failed[@]})); then
  printf -v list '%s, ' "${failed[@]}"
  fail "not in order: ${list%, }"
fi
say "checks passed"
