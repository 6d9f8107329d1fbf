#!/usr/bin/env bash
# self-contained.sh BUILD FOLDER: packs the program of a build folder with all libraries that it needs, but for
# those of the C library. Writes FOLDER/understory-VERSION-MACHINE-glibcN.tar.gz and prints its name.
# It runs where the C library is N or newer, from any folder. Debian's GDAL cannot be linked in, since it is only
# packaged as a shared library, so libraries lie beside the program.
set -euo pipefail
build=$1 folder=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
version=$("$build/understory" --version)
glibc=$(ldd --version | sed -n '1 s/.* //p')
name=understory-$version-$(uname -m)-glibc$glibc
tree=$work/$name
cmake --install "$build" --prefix "$tree" --strip >"$work/install.log" || { cat "$work/install.log" >&2; exit 1; }

# The file behind each library that is loaded, and the package that it comes from.
package_of() { # merged /usr: dpkg may know the file by its former place
  local real
  real=$(realpath "$1")
  { dpkg-query -S "$real" "${real#/usr}" 2>/dev/null || true; } | sed -n '1 s/[:,].*//p'
}
list=$tree/share/doc/understory/libraries
mkdir -p "$tree/lib" "$list"
loaded=$(ldd "$tree/bin/understory")
if grep 'not found' <<<"$loaded" >&2; then exit 1; fi
while read -r soname _ path _; do
  [[ $path == /* ]] || continue
  package=$(package_of "$path")
  [[ -n $package ]] || { echo "self-contained.sh: no package has $path" >&2; exit 1; }
  if [[ $package == libc6 ]]; then continue; fi
  cp "$(realpath "$path")" "$tree/lib/$soname"
  echo "$package"
done <<<"$loaded" | sort -u >"$work/packages"
for package in $(cat "$work/packages") proj-data; do
  mkdir -p "$list/$package"
  cp -L "/usr/share/doc/$package/copyright" "$list/$package/"
done
dpkg-query -W -f '${binary:Package} ${Version} (source ${source:Package} ${source:Version})\n' \
  $(cat "$work/packages") proj-data >"$list/versions.txt"
# What the copyright files refer to.
cp -rL /usr/share/common-licenses "$tree/share/doc/understory/licenses"
# Of old, so that it holds for what the libraries load, too.
patchelf --force-rpath --set-rpath '$ORIGIN/../lib' "$tree/bin/understory"
# PROJ looks for its database beside itself: ../share/proj.
mkdir -p "$tree/share/proj"
cp -L /usr/share/proj/proj.db "$tree/share/proj/"
mkdir -p "$folder"
tar -C "$work" --sort=name --owner=0 --group=0 --numeric-owner -czf "$folder/$name.tar.gz" "$name"
echo "$folder/$name.tar.gz"
