#!/usr/bin/env bash
# tidy.sh [--seconds S] [BASE|all]: clang-tidy on the .cc files (tests apart) that differ from the commit BASE, or on
# every one. The default is where this branch left main; on main the last commit. Those that changed most come first.
# With --seconds no file is begun after that time, and how many are left is said.
# A file that passed before is passed over: the cache holds the hash of each that did, taken over
# its preprocessed text and the configuration.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
cd "$top"

default_base() {
  local base
  base=$(git merge-base HEAD origin/main 2>/dev/null || git merge-base HEAD main 2>/dev/null || true)
  if [[ -z $base || $base == $(git rev-parse HEAD) ]]; then
    base=$(git rev-parse -q --verify HEAD~1 || git hash-object -t tree /dev/null)
  fi
  echo "$base"
}

tidy_file() { # one .cc file
  local file=$1 command hash
  command=$(python3 - "$file" <<'EOF'
import json, os, shlex, sys
for entry in json.load(open("build-tidy/compile_commands.json")):
    if os.path.relpath(entry["file"]) == sys.argv[1]:
        words = shlex.split(entry["command"])
        compiler = next(i for i, w in enumerate(words) if "clang" in os.path.basename(w))
        words = words[compiler:]  # without ccache before it
        keep = [w for i, w in enumerate(words) if w not in ("-c", "-o") and words[i - 1] != "-o"]
        print("cd " + shlex.quote(entry["directory"]) + " && " + shlex.join(keep + ["-E", "-P"]))
        break
EOF
  )
  if [[ -z $command ]]; then return; fi # not part of this build
  hash=$( (cat .clang-tidy; bash -c "$command") | sha256sum | cut -c1-32)
  if [[ -e $cache/tidy/$hash ]]; then return; fi
  clang-tidy -p build-tidy --quiet --warnings-as-errors='*' "$file" 2>/dev/null || return 1
  touch "$cache/tidy/$hash"
}

if [[ ${1:-} == --file ]]; then
  if [[ -n ${UNDERSTORY_TIDY_END:-} ]] && (($(date +%s) >= UNDERSTORY_TIDY_END)); then
    echo "$2" >>build-tidy/left
    exit
  fi
  tidy_file "$2"
  exit
fi
if [[ ${1:-} == --seconds ]]; then
  export UNDERSTORY_TIDY_END=$(($(date +%s) + $2))
  shift 2
fi
if [[ ${1:-} == all ]]; then
  mapfile -t files < <(git ls-files -- 'src/*.cc' ':!*_test.cc')
else
  mapfile -t files < <(git diff --numstat --diff-filter=d "${1:-$(default_base)}" -- 'src/*.cc' ':!*_test.cc' |
    sort -k1,1nr -k3 | cut -f3)
fi
if ((${#files[@]} == 0)); then
  say "no changed files"
  exit
fi
mkdir -p build-tidy "$cache/tidy"
cmake --preset tidy >build-tidy/configure.log 2>&1 || { tail -n 20 build-tidy/configure.log >&2; exit 1; }
rm -f build-tidy/left
code=0
printf '%s\0' "${files[@]}" | xargs -0 -r -n 1 -P "$(nproc)" "$0" --file || code=1
if [[ -s build-tidy/left ]]; then say "$(wc -l <build-tidy/left) of ${#files[@]} files were not looked at for want of time"; fi
exit "$code"
