#!/usr/bin/env bash
# lock-python.sh: writes the exact versions and hashes of the Python packages that tests and
# benchmarks compare with. There is one file for each list and each Python of a Debian release.
# Versions stay as they are where they can; --upgrade takes the newest. A list of benchmarks/peers
# has no file for a Python that its peer has no wheel for.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
cd "$top"
room=$(mktemp -d)
trap 'rm -rf "$room"' EXIT
python3 -m venv "$room/env"
"$room/env/bin/python" -m pip install -q --disable-pip-version-check uv
for list in benchmarks/peers/*/*.txt tests/recording/hands.txt; do
  for version in 3.11 3.13; do
    say "locking $list for Python $version"
    # glibc 2.36 is that of Debian 12.
    "$room/env/bin/uv" pip compile -q "$@" --python-version "$version" --python-platform x86_64-manylinux_2_36 \
      --no-config --generate-hashes --no-emit-index-url --no-emit-find-links --no-annotate --only-binary :all: \
      --custom-compile-command tools/lock-python.sh \
      --output-file "${list%.txt}-py$version.lock" "$list" ||
      say "$list has no wheels for Python $version"
  done
done
for list in tests benchmarks; do
  for version in 3.11 3.13; do
    say "locking $list/requirements.txt for Python $version"
    "$room/env/bin/uv" pip compile -q "$@" --python-version "$version" --python-platform linux \
      --no-config --generate-hashes --no-emit-index-url --no-emit-find-links --no-annotate \
      --custom-compile-command tools/lock-python.sh \
      --output-file "$top/$list/requirements-py$version.lock" "$top/$list/requirements.txt"
  done
done
