#!/usr/bin/env bash
# trial.sh FILE VERSION: what is tried of a package in a clean system; tools/try-package.sh runs it there as root.
# Installs it, maps a simulated recording, makes the demo, plays an old processor, and removes the package.
set -euo pipefail
file=$1 version=$2
wrong() { echo "trial: $*" >&2; exit 1; }
quietly() { "$@" >/tmp/log 2>&1 || { tail -n 30 /tmp/log >&2; wrong "failed: $*"; }; }
seconds() { date +%s.%N; }
since() { awk -v a="$1" -v b="$(seconds)" 'BEGIN {printf "%.1f", b - a}'; }
mkdir -p /tmp/work && cd /tmp/work
for tool in cc g++ cmake python3 gdalinfo; do
  if command -v "$tool" >/dev/null; then wrong "this system is not clean: it has $tool"; fi
done

begun=$(seconds)
case $file in
  *.deb)
    quietly apt-get -q update
    quietly apt-get -qy --no-install-recommends install "$file"
    program=understory
    ;;
  *)
    mkdir /opt/unpacked
    tar -xf "$file" -C /opt/unpacked
    # Moved after unpacking: it has to run from anywhere.
    mv /opt/unpacked/* "/opt/a folder"
    program="/opt/a folder/bin/understory"
    ;;
esac
installing=$(since "$begun")
said=$("$program" --version)
[[ $said == "$version" ]] || wrong "--version says $said, the package's name $version"
ldd "$(command -v "$program")" | { ! grep 'not found'; } || wrong "libraries are missing"

quietly "$program" simulate demo --seed 4 --duration-s 15 -o walk.mcap
begun=$(seconds)
quietly "$program" map walk.mcap -o run
mapping=$(since "$begun")
for name in report.html map.laz map.qgs trees.csv trees.gpkg dtm.tif trajectory.tum run.json; do
  [[ -s run/$name ]] || wrong "map wrote no $name"
done
grep -q "\"version\": \"$version\"" run/run.json || wrong "run.json tells another version"
grep -q '"status": "complete"' run/run.json || wrong "the run is not complete: $(grep -A4 '"reasons"' run/run.json)"
grep -q 'EPSG' run/run.json || wrong "run.json names no coordinate system, though the recording has satellite positions"
quietly "$program" evaluate run walk.truth --align se3
quietly "$program" map walk.mcap -o run2 --profile harvester --print-config
begun=$(seconds)
quietly "$program" demo
[[ -s demo/report.html ]] || wrong "demo wrote no report"
printf 'trial: installed in %s s, 15 s of recording mapped in %s s (together at most 120 s are wanted); demo in %s s\n' \
  "$installing" "$mapping" "$(since "$begun")"

# A processor of 2008 either runs it or is told why not.
if [[ $(uname -m) == x86_64 ]]; then
  quietly apt-get -q update
  quietly apt-get -qy --no-install-recommends install qemu-user
  code=0
  qemu-x86_64 -cpu Nehalem "$(command -v "$program")" --version >said 2>complaint || code=$?
  case $code in
    0) [[ $(cat said) == "$version" ]] || wrong "on an old processor --version says $(cat said)" ;;
    126) grep 'is built for processors of the level' complaint || wrong "on an old processor: $(cat complaint)" ;;
    *) wrong "on an old processor it ends with $code: $(cat complaint)" ;;
  esac
fi
if [[ $file == *.deb ]]; then
  for name in doc/understory/copyright man/man1/understory.1.gz man/man1/understory-map.1.gz; do
    [[ -s /usr/share/$name ]] || wrong "the package has no /usr/share/$name"
  done
  quietly apt-get -qy purge understory
  for left in /usr/bin/understory /usr/share/understory /usr/share/doc/understory; do
    if [[ -e $left ]]; then wrong "purging it leaves $left"; fi
  done
fi
echo "trial: all in order"
