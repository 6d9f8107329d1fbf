# What ./run and the scripts in tools/ share. Sourced, not run.
top=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cache=${UNDERSTORY_CACHE:-${HOME:-/root}/.cache/understory}
# ccache then knows a file again in another clone of the project.
export CCACHE_BASEDIR=$top CCACHE_NOHASHDIR=1

say() { printf '== %s\n' "$*"; }

fail() {
  printf 'run: %s\n' "$*" >&2
  exit 1
}

# As many jobs as cores, but no more than memory bears (about 1.5 GB for a large file).
jobs_that_fit() {
  local cores memory_kb by_memory
  cores=$(nproc)
  memory_kb=$(awk '/^MemAvailable/ {print $2}' /proc/meminfo)
  by_memory=$((memory_kb / 1500000))
  ((by_memory < 1)) && by_memory=1
  echo $((cores < by_memory ? cores : by_memory))
}

# The presets make warnings errors. The integration sees none with GCC 12; another compiler may warn
# of more, and then who only builds must not be stopped.
lenient_arguments() {
  [[ $("${CXX:-c++}" -dumpversion 2>/dev/null) == 12* ]] || echo -DUNDERSTORY_WARNINGS_AS_ERRORS=OFF
}

configure_preset() { # preset
  local preset=$1 folder log
  folder=$(preset_folder "$preset")
  mkdir -p "$folder"
  log=$folder/configure.log
  if ! cmake --preset "$preset" -S "$top" $(lenient_arguments) ${UNDERSTORY_CMAKE_ARGUMENTS:-} \
      >"$log" 2>&1; then
    tail -n 40 "$log" >&2
    fail "configuring preset $preset failed; the whole log is $log"
  fi
}

# build_preset PRESET [TARGET...]
build_preset() {
  local preset=$1 target_arguments=()
  shift
  configure_preset "$preset"
  if (($#)); then target_arguments=(--target "$@"); fi
  cmake --build "$(preset_folder "$preset")" --parallel "$(jobs_that_fit)" "${target_arguments[@]}"
}

# commit_number BELOW: a number from 0 to BELOW - 1 that the hash of the present commit chooses.
commit_number() {
  local hash
  hash=$(git -C "$top" rev-parse --verify --quiet HEAD || echo 0)
  echo $((16#${hash:0:7} % $1))
}

preset_folder() {
  if [[ $1 == release ]]; then echo "$top/build"; else echo "$top/build-$1"; fi
}
