#!/usr/bin/env bash
# format.sh [--check]: formats the tracked C++ files, or only says which are not as .clang-format
# wants them. Version 14 is the reference; another may differ in details.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
cd "$top"
program=$(command -v clang-format-14 || command -v clang-format) || fail "clang-format is missing: ./run setup check"
mode=(-i)
if [[ ${1:-} == --check ]]; then mode=(--dry-run -Werror); fi
git ls-files -z -- '*.cc' '*.h' | xargs -0 -r -n 20 -P "$(nproc)" "$program" "${mode[@]}"
