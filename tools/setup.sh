#!/usr/bin/env bash
# setup.sh [build|test|check|package]: installs the packages that are missing, and builds once into a cache
# what this release does not package. Does nothing, in a second, where all is there.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

listed() { # names in the lists that a purpose needs
  local lists=(build)
  case $1 in
    test) lists+=(test) ;;
    check) lists+=(test check) ;;
    package) lists+=(package) ;;
  esac
  if available libgtsam-dev; then lists+=(with-libgtsam); fi
  local list
  for list in "${lists[@]}"; do grep -vE '^(#|$)' "$top/tools/packages/$list.txt"; done
}

installed() {
  [[ $(dpkg-query -W -f='${db:Status-Abbrev}' "$1" 2>/dev/null) == ii* ]]
}

available() { apt-cache show --no-all-versions "$1" >/dev/null 2>&1; }

missing() { # of the listed packages; optional ones only where the release has them
  local name
  for name; do
    if installed "${name%\?}"; then continue; fi
    if [[ $name == *\? ]] && ! available "${name%\?}"; then continue; fi
    echo "${name%\?}"
  done
}

as_root() {
  if ((EUID == 0)); then
    "$@"
  elif command -v sudo >/dev/null; then
    sudo "$@"
  else
    fail "installing packages needs root or sudo; missing: ${wanted[*]}"
  fi
}

install_packages() {
  local log
  command -v dpkg-query >/dev/null && command -v apt-get >/dev/null ||
    fail "this set-up knows Debian and its relatives only; elsewhere install what tools/packages/ lists and build with cmake --preset release"
  mapfile -t wanted < <(missing "${all[@]}")
  if ((${#wanted[@]} == 0)); then return; fi
  log=$(mktemp)
  say "set-up: reading the package lists (apt-get update)"
  as_root apt-get -q update >"$log" 2>&1 || { tail -n 20 "$log" >&2; fail "apt-get update failed"; }
  mapfile -t all < <(listed "$purpose")
  mapfile -t wanted < <(missing "${all[@]}")
  say "set-up: installing ${#wanted[@]} packages: ${wanted[*]}"
  as_root env DEBIAN_FRONTEND=noninteractive apt-get -q -y -o Dpkg::Use-Pty=0 \
    install --no-install-recommends "${wanted[@]}" >"$log" 2>&1 ||
    { tail -n 30 "$log" >&2; fail "installing packages failed"; }
  rm -f "$log"
}

purpose=${1:-test}
mapfile -t all < <(listed "$purpose")
install_packages
if ! { installed libgtsam-dev && installed liblaszip-dev; }; then
  "$top/tools/deps/build.sh" >/dev/null
fi
