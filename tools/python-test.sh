#!/usr/bin/env bash
# python-test.sh MODULE,MODULE... SCRIPT ARGUMENTS...: runs a test script in the environment of
# tools/python-env.sh, or exits 77 (ctest's "skipped") when a module that it needs is missing there.
# UNDERSTORY_PYTHON names another interpreter. With UNDERSTORY_PACKAGES, a list of packages, it is that of
# an environment of their own, where that is there.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
modules=$1
shift
python=${UNDERSTORY_PYTHON:-$("$top/tools/python-env.sh" --where)}
if [[ -n ${UNDERSTORY_PACKAGES:-} ]]; then
  own=$("$top/tools/python-env.sh" --where "$UNDERSTORY_PACKAGES")
  if [[ -x $own ]]; then python=$own; fi
fi
if [[ ! -x $python ]]; then python=$(command -v python3) || { echo "no python3"; exit 77; }; fi
if [[ -n $modules ]] && ! "$python" -c "import ${modules//,/, }" 2>/dev/null; then
  for module in ${modules//,/ }; do
    "$python" -c "import $module" 2>/dev/null || echo "skipped: the Python package $module is not installed (tools/python-env.sh)"
  done
  exit 77
fi
export UNDERSTORY_DATA=${UNDERSTORY_DATA:-$top/../shared/data} PYTHONDONTWRITEBYTECODE=1
exec "$python" "$@"
