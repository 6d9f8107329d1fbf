#!/usr/bin/env bash
# try-package.sh [--debian 12|13] FILE...: installs each package (.deb) or tarball in a clean, minimal Debian and maps
# a simulated recording there (packaging/trial.sh). Fails if anything does, and leaves nothing behind but the clean
# base system in the cache. A package is tried on the release that its name tells, by +deb12 or the version of the C
# library. --debian 13 tries a tarball of Debian 12 on the newer release.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
. "$top/tools/clean-debian.sh"
release=
if [[ ${1:-} == --debian ]]; then
  (($# > 1)) || fail "--debian needs a release: 12 or 13"
  release=$2
  shift 2
fi
(($#)) || { sed -n '2,5p' "${BASH_SOURCE[0]}" | sed 's/^# \{0,1\}//' >&2; exit 2; }
for file; do
  [[ -f $file ]] || fail "$file is not there"
  [[ $(basename "$file") =~ ^understory[-_][0-9]+\.[0-9]+\.[0-9]+.*\.(deb|tar\.gz)$ ]] ||
    fail "$file is no package of Understory: its name tells no version"
done
trap remove_rooms EXIT

for file; do
  on=$release
  if [[ -z $on && $file =~ \+deb([0-9]+)_ ]]; then on=${BASH_REMATCH[1]}; fi
  if [[ -z $on && $file == *glibc2.41.tar.gz ]]; then on=13; fi
  on=${on:-12}
  codename=$(codename_of "$on")
  version=$(basename "$file" | sed -E 's/^understory[-_]([0-9.]+).*/\1/')
  clean_room "$codename"
  say "trying $(basename "$file") in a clean Debian $on"
  mkdir "$room/trial"
  cp "$file" "$top/packaging/trial.sh" "$room/trial/"
  in_room "$room" "/trial/trial.sh /trial/$(basename "$file") $version" ||
    fail "$(basename "$file") does not stand its trial on Debian $on"
  remove_rooms
done
