#!/usr/bin/env bash
# sanitize.sh [asan|tsan] [--short] [--seconds S | CTEST ARGUMENTS]
#
# Runs the tests of the layers under a sanitizer, not those of tests/, which run the whole program.
#   --short       without the tests that tools/long_tests.txt lists
#   --seconds S   layer after layer until that time: first those that read files, then the others, with a first one that
#                 the hash of the commit chooses. What is not reached in time is said, and is no failure.
# Leak checks stay off for the libraries that keep caches of their own until the end (GDAL, TBB).
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
cd "$top"
preset=asan short=false seconds=0
if [[ ${1:-} == asan || ${1:-} == tsan ]]; then
  preset=$1
  shift
fi
if [[ ${1:-} == --short ]]; then
  short=true
  shift
fi
if [[ ${1:-} == --seconds ]]; then
  seconds=$2
  shift 2
fi
folder=$(preset_folder "$preset")
export ASAN_OPTIONS=detect_leaks=0:strict_string_checks=1 UBSAN_OPTIONS=print_stacktrace=1
export TSAN_OPTIONS=suppressions=$top/tools/tsan.txt

long_tests() { grep -v '^#' tools/long_tests.txt; }

# The layers that have tests, in the order in which --seconds takes them.
layers_in_turn() {
  local readers="util recording" others=() path turn
  for path in src/understory/*/CMakeLists.txt; do
    path=$(basename "$(dirname "$path")")
    if [[ " $readers " != *" $path "* && -n $(find "src/understory/$path" -name '*_test.cc' -print -quit) ]]; then
      others+=("$path")
    fi
  done
  turn=$(commit_number ${#others[@]})
  echo $readers "${others[@]:turn}" "${others[@]:0:turn}"
}

# One of a layer's two halves. Long tests are named as ctest does, by regular expressions.
run_half() { # layer, half, seconds
  local tests="*"
  if $short; then tests=-$(long_tests | sed -e 's/\\\.$/.*/' -e 's/\\\././g' | paste -sd ':'); fi
  GTEST_TOTAL_SHARDS=2 GTEST_SHARD_INDEX=$2 timeout "$3" "$folder/tests/test_$1" --gtest_brief=1 \
    --gtest_filter="$tests" >"$folder/$1.$2.log" 2>&1
}

in_time() { # seconds
  local end=$((SECONDS + $1)) layer code half halves left=() passed=() failed=()
  configure_preset "$preset"
  for layer in $(layers_in_turn); do
    code=124
    if ((SECONDS < end)); then
      code=0
      timeout $((end - SECONDS)) cmake --build "$folder" --parallel "$(jobs_that_fit)" --target "test_$layer" \
        >"$folder/$layer.log" 2>&1 || code=$?
    fi
    if ((code == 0)); then
      halves=()
      for half in 0 1; do
        run_half "$layer" "$half" $((end - SECONDS + 60)) &
        halves+=($!)
      done
      for half in "${halves[@]}"; do
        # What failed is not hidden by the other half's lack of time.
        wait "$half" || { half=$?; if ((code == 0 || code == 124)); then code=$half; fi; }
      done
    fi
    case $code in
      0) passed+=("$layer") ;;
      124) left+=("$layer") ;;
      *)
        tail -n 60 "$folder/$layer".*log
        failed+=("$layer")
        ;;
    esac
  done
  say "$preset, layers that passed: ${passed[*]:-none}"
  if ((${#left[@]})); then say "not reached in $1 s: ${left[*]}"; fi
  if ((${#failed[@]})); then fail "$preset, layers that failed: ${failed[*]}"; fi
}

if ((seconds)); then
  in_time "$seconds"
  exit
fi
build_preset "$preset" layer_tests
without=()
if $short; then
  tests=$(ctest --test-dir "$folder" -N -L layer)
  while read -r line; do
    grep -qE ": .*$line" <<<"$tests" || fail "tools/long_tests.txt names $line, which is no test"
  done < <(long_tests)
  without=(--exclude-regex "$(long_tests | paste -sd '|')")
fi
ctest --test-dir "$folder" --output-on-failure --parallel "$(nproc)" -L layer "${without[@]}" "$@"
