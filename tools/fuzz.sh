#!/usr/bin/env bash
# fuzz.sh [SECONDS] [TARGET...]: builds the fuzz targets and runs each for SECONDS (default 600). The
# corpus that grows stays in the cache; a find is kept in build-fuzz/finds and makes this fail.
# An input may take 10 s and 2 GB at most. Targets run beside each other, one a core.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
cd "$top"
seconds=${1:-600}
if (($#)); then shift; fi
[[ $seconds =~ ^[0-9]+$ ]] || fail "fuzz.sh: SECONDS is a number, not '$seconds'"
if [[ ! -e fuzz/CMakeLists.txt ]]; then
  say "no fuzz targets"
  exit
fi
tools/setup.sh check
build_preset fuzz fuzz_targets
failed=()
mkdir -p build-fuzz/finds build-fuzz/failed
rm -f build-fuzz/failed/*

fuzz_one() { # program
  local name=${1##*/} corpus seeds=() more=()
  corpus=$cache/fuzz/$name
  mkdir -p "$corpus"
  if [[ -d fuzz/corpus/${name#fuzz_} ]]; then seeds=("fuzz/corpus/${name#fuzz_}"); fi
  # LASzip decodes in a process of its own whose memory is limited; there it may ask for what it likes.
  if [[ $name == fuzz_las ]]; then more=(-malloc_limit_mb=16384); fi
  if "$1" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -print_final_stats=1 "${more[@]}" \
    -artifact_prefix="build-fuzz/finds/$name-" "$corpus" "${seeds[@]}" >"build-fuzz/$name.log" 2>&1; then
    say "$name for $seconds s:" $(grep -E 'stat::number_of_executed_units|stat::peak_rss_mb' "build-fuzz/$name.log")
  else
    say "$name found something:"
    tail -n 30 "build-fuzz/$name.log"
    touch "build-fuzz/failed/$name"
  fi
}

trap 'trap - TERM; kill 0' INT  # what runs in the background does not hear it

# As many at once as there are cores: each uses one.
for program in build-fuzz/fuzz/fuzz_*; do
  [[ -x $program && ! -d $program ]] || continue
  name=${program##*/}
  if (($#)) && [[ " $* " != *" ${name#fuzz_} "* && " $* " != *" $name "* ]]; then continue; fi
  while (($(jobs -rp | wc -l) >= $(jobs_that_fit))); do wait -n || true; done
  fuzz_one "$program" &
done
wait
mapfile -t failed < <(ls build-fuzz/failed)
if ((${#failed[@]})); then fail "found something: ${failed[*]} (inputs in build-fuzz/finds)"; fi
