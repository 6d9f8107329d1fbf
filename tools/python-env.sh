#!/usr/bin/env bash
# python-env.sh: a folder with the Python packages that tests compare with (tests/requirements.txt),
# made once in the cache. Prints its interpreter. Versions and hashes are those of the .lock file for
# this Python (tools/lock-python.sh); where there is none, the newest versions are taken. A package
# that cannot be installed is named and left out; the tests that need it then skip, and the next call
# tries again.
#   python-env.sh --where            prints the interpreter's path without making anything
#   python-env.sh [--where] FILE     the same for another list of packages: a package of one list may
#                                    hold another back (ouster-sdk keeps kiss-icp at an old version)
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
where=0
if [[ ${1:-} == --where ]]; then
  where=1
  shift
fi
requirements=$top/${1:-tests/requirements.txt}
lock=${requirements%.txt}-py$(python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])').lock
if [[ -e $lock ]]; then requirements=$lock; fi
folder=$cache/python/$( (python3 --version; cat "$requirements") | sha256sum | cut -c1-16)

if ((where)) || [[ -e $folder/complete ]]; then
  echo "$folder/bin/python"
  exit
fi

# Each package by itself, its dependencies being on the list too; fails where one failed.
install_each() {
  local entry failed=0
  awk -v folder="$folder" '/^[^ #]/ {n++} n {print > (folder "/entry" n ".txt")}' "$requirements"
  for entry in "$folder"/entry*.txt; do
    if ! "${pip[@]}" --no-deps -r "$entry" >>"$folder/pip.log" 2>&1; then
      say "set-up: $(head -n 1 "$entry" | cut -d' ' -f1) cannot be installed here; what needs it will skip" >&2
      failed=1
    fi
  done
  return "$failed"
}

mkdir -p "$cache/python"
exec 9>"$cache/python/.lock"
flock 9
if [[ ! -e $folder/complete ]]; then
  say "set-up: Python packages of ${requirements#"$top/"}" >&2
  if [[ $requirements != "$lock" ]]; then
    say "set-up: this Python has no ${lock#"$top/"}: the newest versions are taken" >&2
  fi
  python3 -m venv "$folder"
  pip=("$folder/bin/python" -m pip install -q --disable-pip-version-check --prefer-binary)
  if "${pip[@]}" -r "$requirements" >"$folder/pip.log" 2>&1 || install_each; then
    touch "$folder/complete"
  fi
fi
echo "$folder/bin/python"
