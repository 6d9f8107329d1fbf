#!/usr/bin/env bash
# fetch.sh FOLDER PACKAGE...: the upstream tarballs of Debian source packages from a newer release
# than this machine runs. They come through apt, from the mirror that the machine itself uses. apt
# checks their signatures as it does for everything else. Needs no root: all of apt's own state for
# the newer release lies in a private folder. The machine's package lists stay as they are. A
# tarball reaches FOLDER only when it has the SHA-256 that sources.sha256 states for it.
set -euo pipefail
sums=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)/sources.sha256
suite=${UNDERSTORY_SOURCE_SUITE:-trixie}
folder=$1
shift
mkdir -p "$folder"

# sound_in FOLDER PACKAGE...: whether it holds the tarball of each, every byte as expected.
sound_in() {
  local where=$1 package
  shift
  for package; do
    (cd "$where" && grep -F " ${package}_" "$sums" | sha256sum --check --status 2>/dev/null) || return 1
  done
}
if sound_in "$folder" "$@"; then exit 0; fi

echo "fetch: source tarballs of $* from $suite, through apt"
private=$(mktemp -d)
trap 'rm -rf "$private"' EXIT
mkdir -p "$private/lists/partial" "$private/cache/archives/partial" "$private/parts"
in_private=(-o "Dir::State::Lists=$private/lists" -o "Dir::Cache=$private/cache" -o "APT::Sandbox::User=")

uri=$("$(dirname "$sums")/../mirror.sh" | awk '$1 !~ /-/ && !n++ {print $2}')
keyring=/usr/share/keyrings/debian-archive-keyring.gpg
{
  printf 'Types: deb-src\nURIs: %s\nSuites: %s\nComponents: main\n' "$uri" "$suite"
  if [[ -e $keyring ]]; then printf 'Signed-By: %s\n' "$keyring"; fi
} >"$private/parts/newer.sources"
only_newer=("${in_private[@]}" -o "Dir::Etc::SourceList=/dev/null" -o "Dir::Etc::SourceParts=$private/parts")
quietly() { "$@" >"$private/log" 2>&1 || { cat "$private/log" >&2; exit 1; }; }
quietly apt-get -q "${only_newer[@]}" update
mkdir "$private/fetched"
cd "$private/fetched"
quietly apt-get -q "${only_newer[@]}" source --tar-only "$@"
if ! sound_in "$private/fetched" "$@"; then
  echo "fetch.sh: $suite on this machine's mirror gave something else than $sums states for: $*" >&2
  exit 1
fi
cp -- *.orig.tar.* "$folder"
