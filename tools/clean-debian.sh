# Clean, minimal Debian systems in folders, for packages: to build in and to try in. Sourced after lib.sh.
#   clean_room CODENAME           sets `room` to a fresh copy of the release's base system
#   in_room ROOM COMMAND [SOURCE:TARGET]...   runs a shell command in it, with folders of this machine at its paths
#   remove_rooms                  removes the copies that this process made
# The base systems are made once, by debootstrap from the mirror of this machine, in the cache. What is mounted
# lies in a mount namespace of the command alone. So nothing stays mounted, even when the command is killed,
# and removing a copy cannot reach beyond it. Needs root.
rooms_folder=$cache/debian

codename_of() { # 12 or 13
  case $1 in
    12) echo bookworm ;;
    13) echo trixie ;;
    *) fail "packages are made for Debian 12 and 13, not for '$1'" ;;
  esac
}

# The release of this machine, or nothing if it is not Debian.
own_release() { (. /etc/os-release; if [[ $ID == debian ]]; then echo "${VERSION_ID:-}"; fi); }

# What still runs in a copy ends first: when this process is told to end, its command goes on for a moment.
remove_rooms() {
  local copy
  for copy in "$rooms_folder"/room.$$.*; do
    [[ -d $copy ]] || continue
    while stop_processes_in "$copy"; do sleep 0.1; done
    rm -rf --one-file-system "$copy"
  done
}

stop_processes_in() { # a folder that is their root; succeeds if there was one
  local root process found=1
  root=$(realpath "$1")
  for process in /proc/[0-9]*; do
    if [[ $(readlink "$process/root" 2>/dev/null) == "$root" ]]; then
      kill -KILL "${process#/proc/}" 2>/dev/null || true
      found=0
    fi
  done
  return "$found"
}

# Copies that were left by processes which were killed.
remove_stale_rooms() {
  local left number
  for left in "$rooms_folder"/room.*; do
    number=$(basename "$left" | cut -d. -f2)
    if [[ -d $left && ! -d /proc/$number ]]; then rm -rf --one-file-system "$left"; fi
  done
}

# The machine's own apt sources with another release's name, its proxies and its certificate authorities.
write_apt_sources() { # root folder, codename
  local root=$1 codename=$2 suite uri own
  own=$(. /etc/os-release; echo "$VERSION_CODENAME")
  rm -f "$root/etc/apt/sources.list"
  "$top/tools/mirror.sh" | while read -r suite uri; do
    [[ $suite == "$own"* ]] || continue
    printf 'Types: deb\nURIs: %s\nSuites: %s\nComponents: main\nSigned-By: %s\n\n' "$uri" \
      "$codename${suite#"$own"}" /usr/share/keyrings/debian-archive-keyring.gpg
  done >"$root/etc/apt/sources.list.d/debian.sources"
  apt-config dump 2>/dev/null | grep -E '^Acquire::https?::Proxy' >"$root/etc/apt/apt.conf.d/90machine" || true
  if compgen -G '/usr/local/share/ca-certificates/*.crt' >/dev/null; then
    install -D -m 644 -t "$root/usr/local/share/ca-certificates" /usr/local/share/ca-certificates/*.crt
    in_room "$root" 'update-ca-certificates >/dev/null 2>&1'
  fi
}

# base_system CODENAME: makes it where there is none yet.
base_system() {
  local codename=$1 base=$rooms_folder/$1 uri
  if [[ -e $base.complete ]]; then return; fi
  ((EUID == 0)) || fail "a clean Debian needs root: run this command as root"
  [[ -n $(own_release) ]] || fail "a clean Debian is made from the mirror of a Debian machine; this is none"
  mkdir -p "$rooms_folder"
  uri=$("$top/tools/mirror.sh" | awk '$1 !~ /-/ && !n++ {print $2}')
  say "making a clean base system of Debian $codename (once)"
  rm -rf --one-file-system "$base"
  debootstrap --variant=minbase --include=ca-certificates "$codename" "$base" "$uri" \
    >"$base.log" 2>&1 || { tail -n 20 "$base.log" >&2; fail "debootstrap failed; the whole log is $base.log"; }
  write_apt_sources "$base" "$codename"
  touch "$base.complete"
}

clean_room() {
  base_system "$1"
  remove_stale_rooms
  room=$(mktemp -d "$rooms_folder/room.$$.XXXX")
  chmod 755 "$room"
  cp -a "$rooms_folder/$1/." "$room/"
  cp /etc/resolv.conf /etc/hosts "$room/etc/" 2>/dev/null || true
}

in_room() {
  local keep
  mapfile -t keep < <(env | grep -E '^(https?_proxy|HTTPS?_PROXY|no_proxy|NO_PROXY)=' || true)
  setpriv --pdeathsig KILL unshare --mount --pid --fork --kill-child bash -c '
    set -e
    root=$1 command=$2 kept=$3
    shift 3
    mount -t proc proc "$root/proc"
    mount --rbind /dev "$root/dev"
    while (($# > kept)); do
      mkdir -p "$root${1#*:}"
      mount --bind "${1%%:*}" "$root${1#*:}"
      shift
    done
    exec env -i HOME=/root PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin TERM=dumb LANG=C.UTF-8 \
      DEBIAN_FRONTEND=noninteractive "$@" chroot "$root" bash -c "$command"' \
    in_room "$1" "$2" "${#keep[@]}" "${@:3}" "${keep[@]}" </dev/null
}
