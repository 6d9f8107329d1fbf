#!/usr/bin/env bash
# python-env.sh: a folder with the Python packages that tests compare with (tests/requirements.txt),
# made once in the cache. Prints its interpreter. A package that cannot be installed is named and
# left out; the tests that need it then skip.
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
folder=$cache/python/$( (python3 --version; cat "$requirements") | sha256sum | cut -c1-16)

if ((where)) || [[ -e $folder/complete ]]; then
  echo "$folder/bin/python"
  exit
fi
mkdir -p "$cache/python"
exec 9>"$cache/python/.lock"
flock 9
if [[ ! -e $folder/complete ]]; then
  say "set-up: Python packages of ${requirements#"$top/"}" >&2
  python3 -m venv --clear "$folder"
  pip=("$folder/bin/python" -m pip install -q --disable-pip-version-check --prefer-binary)
  if ! "${pip[@]}" -r "$requirements" >"$folder/pip.log" 2>&1; then
    grep -vE '^(#|$)' "$requirements" | while read -r package; do
      "${pip[@]}" "$package" >>"$folder/pip.log" 2>&1 ||
        say "set-up: $package cannot be installed here; what needs it will skip" >&2
    done
  fi
  touch "$folder/complete"
fi
echo "$folder/bin/python"
