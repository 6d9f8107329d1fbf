#!/usr/bin/env bash
# tests-in-turns.sh
# Prints a regular expression of the tests that `./run test` leaves out with this commit. Those that are
# marked IN_TURNS take most of the time; a third of them runs with each commit. The hash of the commit says which.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
cd "$top"
thirds=3
turn=$(commit_number $thirds)
listed=$(ctest --test-dir build -N -L in_turns)
mapfile -t names < <(awk '/Test +#/ {print $NF}' <<<"$listed" | sort)
((${#names[@]} >= thirds)) || fail "fewer than $thirds tests are marked IN_TURNS"
others=()
for i in "${!names[@]}"; do
  if ((i % thirds != turn)); then others+=("${names[i]//./\\.}"); fi
done
say "$((${#names[@]} - ${#others[@]})) of ${#names[@]} long tests have their turn; ./run test --all runs all" >&2
(IFS='|'; echo "^(${others[*]})\$")
