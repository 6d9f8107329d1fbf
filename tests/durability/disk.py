"""What a disk may hold after a power cut at any moment of a run, from the log of power_cut.cc.

The model is the least that POSIX promises:
- Bytes of a file are there once the file was synced. Of what was written since, each block of 4 KiB is there,
  is zeros, or is as before; the file has its new length, its old one, or one in between.
- A name in a folder (of a new file or folder, a rename, a removal) is as it was left once that folder was
  synced. Of what was changed since, each change has happened or has not; a rename happens as one.
  A file that was synced, in a folder that was not, can be gone.
What is chosen is drawn from a seed, so that a moment can be tried again.
"""

import pathlib
import random
import struct

HEAD = struct.Struct("<IIIIQqQ")
MAKE, WRITE, TRUNCATE, RENAME, REMOVE, FOLDER, SYNC, SYNC_ALL, UNKNOWN = range(1, 10)
NAMES = ("", "make", "write", "truncate", "rename", "remove", "make folder", "sync", "sync all", "unknown")
BLOCK = 4096


class Call:
    """One system call that changed something."""

    def __init__(self, kind, path, second, inode, offset, data):
        self.kind, self.path, self.second = kind, path, second
        self.inode, self.offset, self.data = inode, offset, data

    def __str__(self):
        return f"{NAMES[self.kind]} {self.path or self.inode} {self.second}".strip()


def read_log(path):
    """All calls of a log. A call that cannot be followed (a mapped file, say) is an error."""
    calls = []
    raw = memoryview(pathlib.Path(path).read_bytes())
    at = 0
    while at + HEAD.size <= len(raw):
        kind, first, second, _, inode, offset, length = HEAD.unpack_from(raw, at)
        at += HEAD.size
        names = [bytes(raw[at:at + first]).decode(), bytes(raw[at + first:at + first + second]).decode()]
        at += first + second
        calls.append(Call(kind, *names, inode, offset, raw[at:at + length]))
        at += length
        assert kind != UNKNOWN, f"{names} changed by system call {offset}, which is not followed"
    return calls


class File:
    def __init__(self):
        self.changes = []  # (kind, offset, bytes)
        self.synced = 0    # of them

    def sync(self):
        self.synced = len(self.changes)

    @staticmethod
    def apply(content, change):
        kind, offset, data = change
        end = offset + len(data)
        if kind == TRUNCATE:
            del content[offset:]
            content.extend(bytes(offset - len(content)))
        else:
            content.extend(bytes(max(0, end - len(content))))
            content[offset:end] = data

    def content(self, dice, mode):
        content = bytearray()
        for change in self.changes[:self.synced]:
            self.apply(content, change)
        if mode in ("lost", "newest"):
            return content
        for change in self.changes[self.synced:]:
            if mode == "kept":
                self.apply(content, change)
            elif change[0] == TRUNCATE:
                if dice.random() < 0.5:
                    self.apply(content, change)
            else:
                self.spoil(content, change, dice)
        return content

    def spoil(self, content, change, dice):
        _, offset, data = change
        if dice.random() < 0.3:
            return
        for begin in range(0, len(data), BLOCK):
            block = data[begin:begin + BLOCK]
            fate = dice.random()
            if fate < 0.4:
                self.apply(content, (WRITE, offset + begin, block))
            elif fate < 0.7:  # the length without the bytes
                content.extend(bytes(max(0, offset + begin + len(block) - len(content))))


class Folder:
    def __init__(self):
        self.entries = {}  # as the program sees them
        self.changes = []  # (number of the call, name, file or folder or None)
        self.synced = 0

    def change(self, number, name, what):
        self.changes.append((number, name, what))
        if what is None:
            self.entries.pop(name, None)
        else:
            self.entries[name] = what

    def sync(self):
        self.synced = len(self.changes)


class Disk:
    """The watched folder, call by call. `syncs=False`: as if the program had never synced anything."""

    def __init__(self, top, syncs=True):
        self.top, self.syncs = pathlib.Path(top), syncs
        self.root = Folder()
        self.files = {}  # by inode
        self.calls = 0

    def folder_and_name(self, path):
        *above, name = pathlib.Path(path).relative_to(self.top).parts
        folder = self.root
        for part in above:
            folder = folder.entries[part]
        return folder, name

    def at(self, path):
        node = self.root
        for part in pathlib.Path(path).relative_to(self.top).parts:
            node = node.entries[part]
        return node

    def do(self, call):
        self.calls += 1
        if call.kind in (MAKE, FOLDER):
            folder, name = self.folder_and_name(call.path)
            node = File() if call.kind == MAKE else Folder()
            if call.kind == MAKE:
                self.files[call.inode] = node
            folder.change(self.calls, name, node)
        elif call.kind in (WRITE, TRUNCATE):
            self.files[call.inode].changes.append((call.kind, call.offset, call.data))
        elif call.kind == RENAME:
            source, old = self.folder_and_name(call.path)
            target, new = self.folder_and_name(call.second)
            node = source.entries[old]
            source.change(self.calls, old, None)
            target.change(self.calls, new, node)
        elif call.kind == REMOVE:
            folder, name = self.folder_and_name(call.path)
            folder.change(self.calls, name, None)
        elif self.syncs and call.kind == SYNC:
            (self.at(call.path) if call.path else self.files[call.inode]).sync()
        elif self.syncs and call.kind == SYNC_ALL:
            self.sync_all(self.root)

    def sync_all(self, node):
        node.sync()
        for below in getattr(node, "entries", {}).values():
            self.sync_all(below)

    def write(self, into, seed, mode=None):
        """What is left after a cut now, into an empty folder. Mode: of what was not synced everything is
        "lost" or "kept", or "drawn" bit by bit. In "newest" the name that the last call changed is kept and the
        rest is lost: folders do not keep an order. None draws the mode as well."""
        dice = random.Random(seed)
        mode = mode or dice.choice(["lost", "kept", "drawn", "drawn", "drawn"])
        happened = {}
        into = pathlib.Path(into)
        into.mkdir(parents=True, exist_ok=True)

        def has_happened(number):
            if mode == "newest":
                return number == self.calls
            if mode != "drawn":
                return mode == "kept"
            return happened.setdefault(number, dice.random() < 0.5)

        def put(folder, place):
            entries = {}
            for i, (number, name, what) in enumerate(folder.changes):
                if i >= folder.synced and not has_happened(number):
                    continue
                if what is None:
                    entries.pop(name, None)
                else:
                    entries[name] = what
            for name, what in sorted(entries.items()):
                if isinstance(what, Folder):
                    (place / name).mkdir(exist_ok=True)
                    put(what, place / name)
                else:
                    (place / name).write_bytes(what.content(dice, mode))

        put(self.root, into)
        return mode
