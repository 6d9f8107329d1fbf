#!/usr/bin/env bash
# sanitize.sh [asan|tsan] [CTEST ARGUMENTS]: the tests of the layers (not those of tests/, which run
# the whole program) under a sanitizer. Leak checks stay off for the libraries that keep caches of
# their own until the end (GDAL, TBB).
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
cd "$top"
preset=${1:-asan}
if (($#)); then shift; fi
build_preset "$preset" layer_tests
export ASAN_OPTIONS=detect_leaks=0:strict_string_checks=1 UBSAN_OPTIONS=print_stacktrace=1
export TSAN_OPTIONS=suppressions=$top/tools/tsan.txt
ctest --test-dir "build-$preset" --output-on-failure --parallel "$(nproc)" -L layer "$@"
