#!/usr/bin/env python3
"""Fails on any #include in src/understory that does not lead to a layer above its own.

The order of the layers is the list in the top CMakeLists.txt. A file may include its own layer and
those before it; nothing else inside the project, and nothing by a relative path. Fails, too, on a
folder of more than 40 files, a file of more than 500 lines, and two headers of one name. A fuzz target
that takes single files of a high layer (ALONE) must have those of all headers that they include.

    check_layers.py [SOURCE_TREE]     exit 0: in order; 1: prints each wrong arrow; 2: no such tree
"""

import pathlib
import re
import sys

MOST_FILES = 40
MOST_LINES = 500

INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"')
FUZZ_TARGET = re.compile(r"understory_fuzz\((\w+)([^)]*)\)")
LAYERS = re.compile(r"foreach\(layer IN ITEMS\s+([a-z_\s]+)\)")


def layer_order(tree):
    found = LAYERS.search((tree / "CMakeLists.txt").read_text(encoding="utf-8"))
    if not found:
        raise ValueError(f"{tree / 'CMakeLists.txt'}: no list 'foreach(layer IN ITEMS ...)'")
    return found.group(1).split()


def wrong_arrow(layer, included, order):
    """Why a file of `layer` may not include `included`, or None."""
    parts = included.split("/")
    if parts[0] != "understory" or len(parts) < 3:
        return 'own headers are included as "understory/<layer>/<file>.h"'
    if parts[1] not in order:
        return f"{parts[1]} is not a layer"
    if order.index(parts[1]) > order.index(layer):
        return f"{layer} stands above {parts[1]} and may not use it"
    return None


def untidy(tree, root):
    """Yields one line for each folder or file that is too large, and for each name of two headers."""
    folders, headers = {}, {}
    for path in sorted(p for p in root.rglob("*") if p.is_file()):
        folders.setdefault(path.parent, []).append(path)
        lines = path.read_text(encoding="utf-8").count("\n")
        if path.suffix in (".cc", ".h") and lines > MOST_LINES:
            yield f"{path.relative_to(tree)}:1: {lines} lines, {MOST_LINES} at most"
        if path.suffix == ".h":
            if path.name in headers:
                yield f"{path.relative_to(tree)}:1: {headers[path.name].relative_to(tree)} has this name, too"
            headers.setdefault(path.name, path)
    for folder, files in folders.items():
        if len(files) > MOST_FILES:
            yield f"{folder.relative_to(tree)}: {len(files)} files, {MOST_FILES} at most"


def unlinked(tree, root, order):
    """Yields one line for each file that a fuzz target needs beside its ALONE files, and lacks."""
    listed = tree / "fuzz" / "CMakeLists.txt"
    for target, rest in FUZZ_TARGET.findall(listed.read_text(encoding="utf-8")) if listed.is_file() else ():
        words = rest.split()
        if "ALONE" not in words:
            continue
        top = max((order.index(word) for word in words if word in order), default=-1)
        alone = words[words.index("ALONE") + 1:]
        for name in alone:
            for line in (root / name).read_text(encoding="utf-8").splitlines():
                found = INCLUDE.match(line)
                header = found.group(1).removeprefix("understory/") if found else ""
                source = header.removesuffix(".h") + ".cc"
                above = header.split("/")[0] in order and order.index(header.split("/")[0]) > top
                if above and source not in alone and (root / source).is_file():
                    yield f"fuzz/CMakeLists.txt: {target}: {name} needs {source}, which is not among its ALONE files"


def check(tree):
    """Yields one line for each wrong include of a source tree, and for what is untidy in it."""
    order = layer_order(tree)
    root = tree / "src" / "understory"
    for path in sorted(p for p in root.rglob("*") if p.suffix in (".cc", ".h")):
        layer = path.relative_to(root).parts[0]
        name = path.relative_to(tree)
        if layer not in order:
            yield f"{name}:1: {layer} is not a layer of the top CMakeLists.txt"
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            found = INCLUDE.match(line)
            reason = wrong_arrow(layer, found.group(1), order) if found else None
            if reason:
                yield f'{name}:{number}: includes "{found.group(1)}": {reason}'
    yield from untidy(tree, root)
    yield from unlinked(tree, root, order)


def main():
    here = pathlib.Path(__file__).resolve().parent.parent
    tree = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else here
    if not (tree / "CMakeLists.txt").is_file():
        print(f"check_layers.py: {tree} has no CMakeLists.txt", file=sys.stderr)
        return 2
    wrong = list(check(tree))
    print("\n".join(wrong) if wrong else "layers: every include leads upwards, no folder or file is too large")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
