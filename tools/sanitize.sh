#!/usr/bin/env bash
# sanitize.sh [asan|tsan] [--short] [CTEST ARGUMENTS]
# Runs the tests of the layers under a sanitizer, not those of tests/, which run the whole program.
#   --short   without the tests that tools/long_tests.txt lists
# Leak checks stay off for the libraries that keep caches of their own until the end (GDAL, TBB).
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
cd "$top"
preset=${1:-asan}
if (($#)); then shift; fi
short=()
if [[ ${1:-} == --short ]]; then
  shift
  short=(--exclude-regex "$(grep -v '^#' tools/long_tests.txt | paste -sd '|')")
fi
build_preset "$preset" layer_tests
if ((${#short[@]})); then
  tests=$(ctest --test-dir "build-$preset" -N -L layer)
  while read -r line; do
    grep -qE ": .*$line" <<<"$tests" || fail "tools/long_tests.txt names $line, which is no test"
  done < <(grep -v '^#' tools/long_tests.txt)
fi
export ASAN_OPTIONS=detect_leaks=0:strict_string_checks=1 UBSAN_OPTIONS=print_stacktrace=1
export TSAN_OPTIONS=suppressions=$top/tools/tsan.txt
ctest --test-dir "build-$preset" --output-on-failure --parallel "$(nproc)" -L layer "${short[@]}" "$@"
