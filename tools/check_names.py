#!/usr/bin/env python3
"""Fails where two types of one name stand in one namespace of src/understory.

Each may be in order by itself, and no compiler or linker says a word; but their inline functions
and the templates over them are one symbol, of which the linker keeps either.

    check_names.py [SOURCE_TREE]     exit 0: in order; 1: prints each pair; 2: no such tree
"""

import pathlib
import re
import sys

OPENED = re.compile(r"^(?:inline )?namespace(?: ([\w:]+))? \{")
CLOSED = re.compile(r"^\}  // namespace")
TYPE = re.compile(r"^(?:struct|class|enum class|enum|union) (?:alignas\(\w+\) )?(\w+)(?: final)?"
                  r"(?: ?:[^:].*)?(?: \{.*)?$")


def types_of(path):
    """(name with its namespaces, line) of each type that others could see."""
    spaces = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        opened = OPENED.match(line)
        if opened:
            spaces.append(opened.group(1))
        elif CLOSED.match(line) and spaces:
            spaces.pop()
        else:
            found = TYPE.match(line)
            if found and not line.rstrip().endswith(";") and None not in spaces:
                yield "::".join([*spaces, found.group(1)]), number


def check(tree):
    """Yields one line for each type whose name another one has."""
    root = tree / "src" / "understory"
    first = {}
    for path in sorted(p for p in root.rglob("*") if p.suffix in (".cc", ".h")):
        for name, number in types_of(path):
            place = f"{path.relative_to(tree)}:{number}"
            if name in first:
                yield f"{place}: {name} is also a type of {first[name]}"
            first.setdefault(name, place)


def main():
    here = pathlib.Path(__file__).resolve().parent.parent
    tree = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else here
    if not (tree / "src" / "understory").is_dir():
        print(f"check_names.py: {tree} has no src/understory", file=sys.stderr)
        return 2
    pairs = list(check(tree))
    print("\n".join(pairs) if pairs else "names: every type has one of its own")
    return 1 if pairs else 0


if __name__ == "__main__":
    sys.exit(main())
