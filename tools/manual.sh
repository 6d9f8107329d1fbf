#!/usr/bin/env bash
# manual.sh PROGRAM FOLDER: manual pages of the program and of each of its commands, made by help2man of what
# --help says: FOLDER/understory.1.gz, understory-map.1.gz ...
set -euo pipefail
program=$1 folder=$2
version=$("$program" --version)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$folder"
# The pages call the program by its name, not by its place in the build folder.
ln -s "$(realpath "$program")" "$work/understory"
export PATH=$work:$PATH

page() { # name of the page, the command that it describes, what it does
  help2man --no-info --no-discard-stderr --version-string="$version" --source="Understory $version" \
    --manual="Understory" --name="$3" "$2" |
    sed -e "s/^\.TH [A-Z-]*/.TH ${1^^}/" -e "/^\.SH NAME/ {n; s/^[a-z ]*/$1 /}" >"$work/$1.1"
  gzip -9n -c "$work/$1.1" >"$folder/$1.1.gz"
}

understory --help | sed -n '/^Subcommands:/,$ s/^  \([a-z]\+\) \+\(.*\)/\1 \2/p' >"$work/commands"
[[ -s $work/commands ]] || { echo "manual.sh: $program --help lists no commands" >&2; exit 1; }
while read -r command does; do page "understory-$command" "understory $command" "$does"; done <"$work/commands"
page understory understory "lidar SLAM and tree mapping under the forest canopy"
