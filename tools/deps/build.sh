#!/usr/bin/env bash
# Builds GTSAM and LASzip once into a cache, for systems that do not package them (Debian 12).
#   build.sh            builds what is missing, then prints the folder
#   build.sh --where    prints the folder that this machine's build belongs in
#   build.sh --march    prints the instruction set that the folder is built for (may be empty)
# The folder's name is a hash of everything that decides its content: versions, flags, compiler,
# Eigen and the two CMake files. UNDERSTORY_CACHE moves the cache, UNDERSTORY_MARCH names another
# instruction set ("none" for the compiler's default).
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cache=${UNDERSTORY_CACHE:-${HOME:-/root}/.cache/understory}
gtsam_flags="-O2 -DNDEBUG"

march() {
  local cpu
  if [[ -n ${UNDERSTORY_MARCH:-} ]]; then
    [[ $UNDERSTORY_MARCH == none ]] || echo "$UNDERSTORY_MARCH"
  elif [[ $(uname -m) == x86_64 ]] && cpu=$(grep -m1 '^flags' /proc/cpuinfo) &&
    [[ $cpu == *" avx2 "* && $cpu == *" fma "* && $cpu == *" bmi2 "* && $cpu == *" movbe "* ]]; then
    echo x86-64-v3
  fi
}

eigen_version() {
  local macros=/usr/include/eigen3/Eigen/src/Core/util/Macros.h
  if [[ -e $macros ]]; then grep -E 'define EIGEN_[A-Z]+_VERSION [0-9]' "$macros"; fi
}

key() {
  {
    uname -m; march; echo "$gtsam_flags"; "${CXX:-g++}" -dumpfullversion 2>/dev/null || true
    eigen_version
    ls /usr/include/boost/version.hpp 2>/dev/null && grep 'define BOOST_LIB_VERSION' /usr/include/boost/version.hpp
    cat "$here/gtsam/CMakeLists.txt" "$here/laszip/CMakeLists.txt"
  } | sha256sum | cut -c1-16
}

build_one() { # name, source tree, extra cmake arguments...
  local name=$1 tree=$2 prefix=$3 work=$4; shift 4
  local launcher=()
  if command -v ccache >/dev/null; then launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache); fi
  cmake -S "$here/$name" -B "$work/$name" -G Ninja -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_CXX_FLAGS_RELEASE="$gtsam_flags" "${launcher[@]}" -DUNDERSTORY_MARCH="$(march)" \
    -D"${name^^}_TREE=$tree" -DCMAKE_INSTALL_PREFIX="$prefix" "$@" >"$work/$name.log" 2>&1 &&
    cmake --build "$work/$name" >>"$work/$name.log" 2>&1 &&
    cmake --install "$work/$name" >>"$work/$name.log" 2>&1 || {
    echo "building $name failed; the end of its log:" >&2
    tail -n 40 "$work/$name.log" >&2
    return 1
  }
}

main() {
  local where work prefix
  where=$cache/deps/$(key)
  case ${1:-} in
    --where) echo "$where"; return ;;
    --march) march; return ;;
    "") ;;
    *) sed -n '2,9p' "${BASH_SOURCE[0]}" >&2; return 2 ;;
  esac
  if [[ -e $where/complete ]]; then echo "$where"; return; fi

  mkdir -p "$cache/deps"
  exec 9>"$cache/deps/.lock"
  flock 9
  if [[ -e $where/complete ]]; then echo "$where"; return; fi
  work=$cache/deps/.work
  prefix=$work/prefix
  rm -rf "$work" "$where"
  mkdir -p "$work"
  "$here/fetch.sh" "$cache/sources" gtsam laszip >&2
  for tarball in "$cache"/sources/{gtsam,laszip}_*.orig.tar.*; do tar -xf "$tarball" -C "$work"; done
  echo "dependencies: building LASzip" >&2
  build_one laszip "$(echo "$work"/LASzip-*)" "$prefix" "$work"
  echo "dependencies: building GTSAM (some minutes, once)" >&2
  build_one gtsam "$(echo "$work"/gtsam-4*)" "$prefix" "$work"
  march >"$prefix/march"
  touch "$prefix/complete"
  mv "$prefix" "$where"
  rm -rf "$work"
  echo "$where"
}

main "$@"
