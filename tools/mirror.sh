#!/usr/bin/env bash
# mirror.sh: Debian's mirrors in this machine's apt configuration, whichever form (.sources or .list) that has.
# Prints a line "SUITE URI" for each suite of the component main (bookworm, bookworm-updates, bookworm-security).
# apt tells them only for lists that it holds; a machine that holds none gets them in a private folder.
set -euo pipefail

suites() {
  apt-get "$@" indextargets --format '$(ORIGIN)|$(LABEL)|$(COMPONENT)|$(CODENAME) $(REPO_URI)' 2>/dev/null |
    awk -F'|' '$1 == "Debian" && $2 ~ /^Debian(-Security)?$/ && $3 == "main" && !seen[$4]++ {print $4}'
}

found=$(suites)
if [[ -z $found ]]; then
  private=$(mktemp -d)
  trap 'rm -rf "$private"' EXIT
  mkdir -p "$private/lists/partial" "$private/cache/archives/partial"
  in_private=(-o "Dir::State::Lists=$private/lists" -o "Dir::Cache=$private/cache" -o "APT::Sandbox::User=")
  apt-get -q "${in_private[@]}" update >/dev/null
  found=$(suites "${in_private[@]}")
fi
if [[ -z $found ]]; then
  echo "mirror.sh: apt on this machine knows no Debian mirror (tried: apt-get indextargets)" >&2
  exit 1
fi
echo "$found"
