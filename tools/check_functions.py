#!/usr/bin/env python3
"""Fails where a function of src/understory is longer than 60 lines or has more than 7 parameters.
It also fails where one calls std::stable_sort, which sort_stably of util/stable_sort.h replaces.

A function's lines count from the first one of its signature to its closing brace, with what lies in
between: comments, empty lines, lambdas. Parameters count at definitions; an override has those of
its base, which may be another library's. Tests are code like the rest. A brace counter reads the
files, so no compiler is needed.

    check_functions.py [SOURCE_TREE]     exit 0: in order; 1: prints each finding; 2: no such tree
"""

import pathlib
import re
import sys

MOST_LINES = 60
MOST_PARAMETERS = 7
# A call, the file that may have it, and why others may not.
REPLACED = [("std::stable_sort(", "util/stable_sort.h",
             "sort_stably of util/stable_sort.h also sorts types that need more than malloc's alignment")]

TOKENS = re.compile(r"""//[^\n]* | /\*.*?\*/ | R"(?P<mark>[^(\s]*)\(.*?\)(?P=mark)"
                        | "(?:\\.|[^"\\\n])*" | (?<![0-9a-fA-F])'(?:\\.|[^'\\\n])+'
                        | ^[ \t]*\#(?:[^\n]*\\\n)*[^\n]*""",
                    re.VERBOSE | re.DOTALL | re.MULTILINE)
SCOPE = re.compile(r"^(?:inline\s+)?(?:namespace\b|extern\s*$)|^(?:template\s*<.*>\s*)?"
                   r"(?:typedef\s+)?(?:struct|class|union|enum)\b(?!.*\)\s*(?:const)?\s*$)", re.DOTALL)
NAME = re.compile(r"((?:[\w~]+(?:<[^()]*>)?\s*::\s*)*(?:operator\s*(?:\(\)|[^\s\w(]+|[\w:<>]+)|~?\w+))\s*$")


def blanked(text):
    """`text` with comments, strings and preprocessor lines as blanks; lines keep their numbers."""
    return TOKENS.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), text)


def closing(text, opened):
    """Where the bracket at `opened` is closed."""
    pairs = {"(": ")", "{": "}", "[": "]"}
    stack = []
    for place in range(opened, len(text)):
        mark = text[place]
        if mark in pairs:
            stack.append(pairs[mark])
        elif stack and mark == stack[-1]:
            stack.pop()
            if not stack:
                return place
    return len(text)


def parameters_of(text):
    """How many parameters the text between a signature's parentheses names."""
    if text.strip() in ("", "void"):
        return 0
    text = re.sub(r"->|<=|>=|<<|>>(?=\s*\()", "  ", text)
    depth = count = 0
    for mark in text:
        depth += mark in "([{<"
        depth -= mark in ")]}>"
        count += mark == "," and depth == 0
    return count + 1


def signature_of(head):
    """(name, parameters) where `head`, the text before a brace, is a function's signature."""
    start = 0
    while True:
        opened = head.find("(", start)
        if opened < 0:
            return None
        named = NAME.search(head[:opened])
        if named and named.group(1).endswith("operator"):
            start = opened + 1  # operator()
            continue
        end = closing(head, opened)
        name = named.group(1) if named else ""
        if not name or name in ("alignas", "decltype", "noexcept", "requires", "__attribute__"):
            start = end + 1
            continue
        before = head[: named.start()]
        if "=" in re.sub(r"template\s*<.*?>\s*(?=\w)|operator\S*", "", before):
            return None  # an initialiser
        is_override = re.search(r"\boverride\b", head[end:]) is not None
        return re.sub(r"\s+", "", name), 0 if is_override else parameters_of(head[opened + 1:end])


def functions_of(text):
    """(name, first line, lines, parameters) of each function with a body, those of classes too."""
    text = blanked(text)
    place = begin = 0
    while place < len(text):
        mark = text[place]
        if mark in ";}":
            begin = place + 1
        elif mark in "([":
            place = closing(text, place)
        elif mark == ":" and re.search(r"\b(?:public|private|protected)\s*$", text[begin:place]):
            begin = place + 1
        elif mark == "{":
            head = text[begin:place].strip()
            if SCOPE.match(head):
                begin = place + 1
            else:
                end = closing(text, place)
                signature = signature_of(head)
                after = text[end + 1:].lstrip()[:1]
                if signature and after in ("{", ",") and ":" in head:
                    place = end + 1  # a member of an initialiser list; the body follows
                    continue
                if signature:
                    first = text.count("\n", 0, place - len(text[begin:place].lstrip())) + 1
                    yield signature[0], first, text.count("\n", 0, end) + 2 - first, signature[1]
                    begin = end + 1
                place = end
        place += 1


def replaced_calls(path, text):
    """One line for each call in a file, given without its comments, that another one replaces."""
    for call, home, why in REPLACED:
        if not path.as_posix().endswith(home):
            for number, line in enumerate(text.splitlines(), 1):
                if call in line:
                    yield f"{path}:{number}: {call[:-1]}: {why}"


def check(tree):
    """Yields one line for each function that is too long, has too many parameters or a replaced call."""
    root = tree / "src" / "understory"
    for path in sorted(p for p in root.rglob("*") if p.suffix in (".cc", ".h")):
        text = path.read_text(encoding="utf-8")
        yield from replaced_calls(path.relative_to(tree), blanked(text))
        for name, first, lines, parameters in functions_of(text):
            place = f"{path.relative_to(tree)}:{first}: {name}"
            if lines > MOST_LINES:
                yield f"{place} has {lines} lines; at most {MOST_LINES}"
            if parameters > MOST_PARAMETERS:
                yield f"{place} has {parameters} parameters; at most {MOST_PARAMETERS}"


def main():
    here = pathlib.Path(__file__).resolve().parent.parent
    tree = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else here
    if not (tree / "src" / "understory").is_dir():
        print(f"check_functions.py: {tree} has no src/understory", file=sys.stderr)
        return 2
    found = list(check(tree))
    print("\n".join(found) if found else "functions: none too long, none with too many parameters, no replaced calls")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
