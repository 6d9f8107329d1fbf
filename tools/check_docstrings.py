#!/usr/bin/env python3
"""Fails where a class, struct, enum or free function of a header has no comment. It fails, too, where a
number of a table (x_constants.h) does not say in brackets where it comes from.

A comment stands on the line above or on the declaration's own line. One above the first of a group holds
for the whole group: the declarations below it up to the next empty line. Exempt are members (their names
say it, or their class does), operators, and declarations without a body of types that another header
defines. So are `describe(ConfigTable&, ...)`, which util/config/config.h explains for all, what lies in
a namespace called detail, and headers of tests (test_*.h, *_test_support.h).

    check_docstrings.py [SOURCE_TREE]    exit 0: in order; 1: prints each finding; 2: no such tree
"""

import pathlib
import re
import sys

from check_functions import blanked, closing

TYPE = re.compile(r"^(?:template\s*<.*?>\s*(?:requires\b.*?)?)?(?:struct|class|union|enum(?:\s+class)?)\s+"
                  r"(?:\[\[\w+\]\]\s*|alignas\(\w+\)\s*)*(\w+)", re.DOTALL)
FUNCTION = re.compile(r"([\w:]+)\s*$")
CONSTANT = re.compile(r"\s*inline constexpr [\w:]+ (\w+) = ")
NAMESPACE = re.compile(r"^(?:inline\s+)?namespace(?:\s+([\w:]+))?$")


def declarations_of(text):
    """(name, first line, last line) of each type with a body and free function of a header."""
    code = blanked(text)
    place = begin = 0
    inside = []  # where the namespaces end, and whether they are to be read

    def found(name, end):
        start = begin + len(code[begin:]) - len(code[begin:].lstrip())
        return name, code.count("\n", 0, start) + 1, code.count("\n", 0, end) + 1

    while place < len(code):
        mark = code[place]
        head = code[begin:place].strip()
        if mark in "([":
            place = closing(code, place)
        elif mark == "}":
            if inside:
                inside.pop()
            begin = place + 1
        elif mark == "{":
            namespace = NAMESPACE.match(head)
            if namespace:
                inside.append(namespace.group(1))
                begin = place + 1
            else:
                end = closing(code, place)
                kind = TYPE.match(head)
                name = kind.group(1) if kind else function_name(head)
                if name and "detail" not in inside:
                    yield found(name, place)
                if kind:  # members are not looked at; a variable may follow, up to the semicolon
                    end = code.find(";", end)
                elif not name:
                    end = code.find(";", end) if code[end + 1:].lstrip()[:1] == ";" else end
                place = end
                begin = end + 1
        elif mark == ";":
            name = None if TYPE.match(head) else function_name(head)
            if name and "detail" not in inside:
                yield found(name, place)
            begin = place + 1
        place += 1


def function_name(head):
    """The name of the free function that `head` declares, if it is one that needs a comment."""
    head = re.sub(r"^template\s*<.*?>\s*(?=\w)|\[\[\w+\]\]\s*", "", head, flags=re.DOTALL)
    if "(" not in head or re.match(r"(?:using|typedef|friend|static_assert|extern template)\b", head):
        return None
    before = head[:head.index("(")]
    if "=" in before or "operator" in before or "::" in before.split()[-1]:
        return None
    named = FUNCTION.search(before)
    if not named or len(before.split()) < 2 or named.group(1) in ("alignas", "decltype", "requires"):
        return None
    if named.group(1) == "describe" and "ConfigTable&" in head:
        return None
    return named.group(1)


def is_told(lines, first, last):
    """Whether a comment stands at the lines first..last, above them, or above their group."""
    if any("//" in line for line in lines[first - 1:last]):
        return True
    for line in reversed(lines[:first - 1]):
        if not line.strip():
            return False
        if line.lstrip().startswith("//"):
            return True
    return False


def unexplained(lines):
    """(name, line) of each number of a table whose comment does not end in its source."""
    for number, line in enumerate(lines, 1):
        constant = CONSTANT.match(line)
        if constant and not re.match(r"\s*//.*\]$", lines[number - 2]):
            yield constant.group(1), number


def check(tree):
    """Yields one line for each declaration without a comment, and each number without a source."""
    root = tree / "src" / "understory"
    for path in sorted(root.rglob("*.h")):
        if path.name.startswith("test_") or path.name.endswith("_test_support.h"):
            continue
        text = path.read_text(encoding="utf-8")
        lines = text.splitlines()
        for name, first, last in declarations_of(text):
            if not is_told(lines, first, last):
                yield f"{path.relative_to(tree)}:{first}: {name} has no comment"
        if path.name.endswith("_constants.h"):
            for name, number in unexplained(lines):
                yield f"{path.relative_to(tree)}:{number}: {name} does not say [where it is from]"


def main():
    here = pathlib.Path(__file__).resolve().parent.parent
    tree = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else here
    if not (tree / "src" / "understory").is_dir():
        print(f"check_docstrings.py: {tree} has no src/understory", file=sys.stderr)
        return 2
    found = list(check(tree))
    print("\n".join(found) if found else "docstrings: every type and free function has one")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
