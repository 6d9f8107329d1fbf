#!/usr/bin/env bash
# package.sh [--debian 12|13] [--march LEVEL] [--no-trial]: makes a Debian package and a tarball
# with all libraries in out/. It takes the sources as they lie here, and tries both in a clean
# system.
#   --debian    the release that they are for; another than this machine's is built in a clean system of that release
#   --march     the instruction set: x86-64-v3 where not said, "none" for all processors of the architecture
#   --no-trial  does not try them
# A trial, and another release, need root. docs/guides/install.md says what comes of it.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
. "$top/tools/clean-debian.sh"
cd "$top"
usage() { sed -n '2,7p' "${BASH_SOURCE[0]}" | sed 's/^# \{0,1\}//' >&2; exit 2; }

# Haswell (2013), Zen (2017) and newer. The usual build takes the same on these, so results are the same bytes.
level() {
  if [[ -n $march ]]; then echo "$march"; elif [[ $(uname -m) == x86_64 ]]; then echo x86-64-v3; else echo none; fi
}

packaged_gtsam() { [[ $(dpkg-query -W -f='${db:Status-Abbrev}' libgtsam-dev 2>/dev/null) == ii* ]]; }

build_here() {
  UNDERSTORY_MARCH=$(level)
  export UNDERSTORY_MARCH
  "$top/tools/setup.sh" package # with dependencies of this instruction set, in a folder of their own
  if packaged_gtsam; then
    if [[ -n $march && $march != none ]]; then
      fail "--march $march: this release's GTSAM is for all processors, and the program has to be as well"
    fi
    UNDERSTORY_MARCH=none
  fi
  local flags=$UNDERSTORY_MARCH
  if [[ $flags == none ]]; then flags=; fi
  say "building the program (instruction set: $UNDERSTORY_MARCH)"
  UNDERSTORY_CMAKE_ARGUMENTS="-DUNDERSTORY_MARCH=$flags" build_preset package
  # Messages of defects name source files; ccache makes their paths relative (CCACHE_BASEDIR).
  if LC_ALL=C grep -qaP "(?<![\w./-])\Q$top\E/" build-package/understory; then fail "the program names the folder $top: build it with ccache"; fi
  say "packing"
  rm -rf build-package/packed
  (cd build-package && cpack -B packed >packed.log 2>&1) || { tail -n 20 build-package/packed.log >&2; fail "cpack failed"; }
  mkdir -p out
  made=(out/"$(basename build-package/packed/*.deb)")
  mv build-package/packed/*.deb out/
  made+=("$(tools/self-contained.sh build-package out)")
}

# The files of the project: what git tracks and what it does not ignore; without git, all but what was built.
copy_sources() {
  mkdir -p "$1"
  if git rev-parse --is-inside-work-tree >/dev/null 2>&1; then
    git ls-files -z --cached --others --exclude-standard |
      while IFS= read -r -d '' file; do if [[ -e $file ]]; then printf '%s\0' "$file"; fi; done
  else
    find . \( -path './build*' -o -path ./out -o -path ./.git \) -prune -o -type f -print0
  fi | tar --null -T - -cf - | tar -xf - -C "$1"
}

build_in_room() {
  local codename words=(./run package --no-trial)
  codename=$(codename_of "$release")
  if [[ -n $march ]]; then words+=(--march "$march"); fi
  clean_room "$codename"
  trap remove_rooms EXIT
  copy_sources "$room/project"
  mkdir -p "$cache/debian/$codename.cache" out
  say "building for Debian $release in $room"
  touch "$room/begun"
  in_room "$room" "cd /project && ${words[*]}" "$cache/debian/$codename.cache:/root/.cache" "$top/out:/project/out"
  mapfile -t made < <(find out -newer "$room/begun" -type f -name 'understory*' | sort)
  remove_rooms
}

read_arguments() {
  release=$(own_release)
  march=
  trial=1
  while (($#)); do
    case $1 in
      --debian | --march)
        (($# > 1)) || usage
        if [[ $1 == --debian ]]; then release=$2; else march=$2; fi
        shift 2
        ;;
      --no-trial) trial=0; shift ;;
      *) usage ;;
    esac
  done
  [[ -n $release ]] || fail "packages are made on Debian; this is another system"
  codename_of "$release" >/dev/null
  case $march in
    "" | none | x86-64-v[234]) ;;
    *) fail "--march $march: known are none, x86-64-v2, x86-64-v3 and x86-64-v4" ;;
  esac
  if ((EUID != 0)) && { ((trial)) || [[ $release != "$(own_release)" ]]; }; then
    fail "trying packages in a clean system needs root (--no-trial makes them for this release without)"
  fi
}

main() {
  read_arguments "$@"
  if [[ $release == "$(own_release)" ]]; then build_here; else build_in_room; fi
  ((${#made[@]} == 2)) || fail "made ${#made[@]} files and not 2: ${made[*]}"
  if ((trial)); then tools/try-package.sh --debian "$release" "${made[@]}"; fi
  say "made: $(du -h "${made[@]}" | awk '{printf "%s%s (%s)", sep, $2, $1; sep = ", "}')"
}

main "$@"
