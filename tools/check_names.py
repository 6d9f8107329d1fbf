#!/usr/bin/env python3
"""Fails where one name of src/understory has two meanings, and no compiler or linker says a word.

Two types of one name in one namespace: each may be in order by itself. But their inline functions and
the templates over them are one symbol, of which the linker keeps either.

A number of a table (x_constants.h) and a constant of another file of the layer. Where eight files are
compiled together, the constant hides the number, if it comes first. Files that are APART are exempt.

Two types or constants of one name in unnamed namespaces of a layer. The number of the layer's files
decides whether theirs are compiled together, and then they do not compile. APART files are exempt, and
so are files between which a `|` stands in the layer's list.

Two of anything of one name in unnamed namespaces of a layer's tests, which are compiled together, too.
Of functions, the compiler would take the one whose parameters fit. A `using` may stand in several;
no test has a `using namespace` or a macro.

    check_names.py [SOURCE_TREE]     exit 0: in order; 1: prints each pair; 2: no such tree
"""

import pathlib
import re
import sys

OPENED = re.compile(r"^(?:inline )?namespace(?: ([\w:]+))? \{")
CLOSED = re.compile(r"^\}  // namespace")
TYPE = re.compile(r"^(?:struct|class|enum class|enum|union) (?:alignas\(\w+\) )?(\w+)(?: final)?"
                  r"(?: ?:[^:].*)?(?: \{.*)?$")
TABLE = re.compile(r"^namespace (\w+) \{.*?\n(.*?)^\}  // namespace \1$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"inline constexpr [^=;]*?\b(k\w+)(?:\[\])? =")
USED = re.compile(r"^using namespace (\w+_constants)::(\w+);", re.MULTILINE)
APART = re.compile(r"^ +APART\s+((?:[\w/.]+\.cc\s+)+)", re.MULTILINE)
SOURCES = re.compile(r"^ +SOURCES\s(.*?)(?:^ +[A-Z_]+\s|\))", re.MULTILINE | re.DOTALL)
COMMENT = re.compile(r"#.*")
CONSTANT = re.compile(r"^(?:static )?constexpr [^=;{(]*?\b(k\w+)\s*(?:\[[^\]]*\])?\s*[={]", re.MULTILINE)
FUNCTION = re.compile(r"^(?!TEST|TYPED_TEST|INSTANTIATE|using |template|return |struct |class )"
                      r"[\w:][\w:<>,&* ]*?[ &*>](\w+)\(")
OBJECT = re.compile(r"^(?:static |inline )*const(?:expr)? [^=;{(]*?[ &*>](\w+)(?:\[[^\]]*\])?\s*[={;(]")
BORROWED = re.compile(r"^using (?:[\w:]+::)?(\w+);")
ALIAS = re.compile(r"^(?:using|namespace) (\w+) = ")


def united(layer):
    """For each set of files that may be compiled together: the text of each. Behind each `|` of the layer's list
    of sources begins a set of its own; the first one takes what stands behind none."""
    lists = layer / "CMakeLists.txt"
    listed = COMMENT.sub("", lists.read_text(encoding="utf-8")) if lists.is_file() else ""
    apart = APART.search(listed)
    sources = SOURCES.search(listed)
    sets = [text.split() for text in sources.group(1).split("|")[1:]] if sources else []
    placed = {layer / name for names in [*sets, apart.group(1).split() if apart else []] for name in names}
    first = [path for path in sorted(layer.rglob("*.cc"))
             if not path.name.endswith("_test.cc") and path not in placed]
    for paths in [first, *([layer / name for name in names] for names in sets)]:
        yield {path: path.read_text(encoding="utf-8") for path in paths if path.is_file()}


def tests(layer):
    """The text of each test of the layer."""
    return {path: path.read_text(encoding="utf-8") for path in sorted(layer.rglob("*_test.cc"))}


def unnamed(text):
    """The lines of unnamed namespaces, but for their own first and last ones."""
    spaces = []
    for line in text.splitlines():
        opened = OPENED.match(line)
        if opened:
            spaces.append(opened.group(1))
        elif CLOSED.match(line) and spaces:
            spaces.pop()
        elif None in spaces:
            yield line


def type_of(line):
    """The type that a line begins to define."""
    return None if line.rstrip().endswith(";") else TYPE.match(line)


def names_of_source(text):
    """(name, what it is) of types and constants of unnamed namespaces."""
    for line in unnamed(text):
        found = CONSTANT.match(line) or type_of(line)
        if found:
            yield found.group(1), None


def names_of_test(text):
    """(name, what it is) of all that stands in unnamed namespaces. None is another thing in each file."""
    for line in unnamed(text):
        borrowed = BORROWED.match(line) or ALIAS.match(line)
        found = borrowed or type_of(line) or OBJECT.match(line) or FUNCTION.match(line)
        if found:
            yield found.group(1), line if borrowed else None


def clashes(sources, names):
    """One line for each name that two files give to something of their own."""
    first = {}
    for path, text in sources.items():
        for name, what in dict.fromkeys(names(text)):
            file, other = first.setdefault(name, (path.name, what))
            if file != path.name and (what is None or what != other):
                yield f"{path.name}: {name} is also a name of {file}: compiled together they clash"


def leaks(sources):
    """One line for each thing in a test that would hold for those compiled behind it, too."""
    for path, text in sources.items():
        for line in text.splitlines():
            if line.startswith(("using namespace ", "#define ")):
                yield f"{path.name}: `{line}` holds for the tests behind it, too"


def hidden_numbers(layer, sources):
    """One line for each number of a table that a constant of another file of the layer may hide."""
    tables = {}
    for path in layer.glob("*_constants.h"):
        for name, body in TABLE.findall(path.read_text(encoding="utf-8")):
            tables[(path.stem, name)] = NUMBER.findall(body)
    own = {}
    for path, text in sources.items():
        for name in CONSTANT.findall(text):
            own.setdefault(name, path)
    for path, text in sources.items():
        for table in USED.findall(text):
            for name in tables.get(table, []):
                if own.get(name, path) != path:
                    yield f"{path.name}: {name} of its table is also a constant of {own[name].name}"


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
    """Yields one line for each name with two meanings."""
    root = tree / "src" / "understory"
    first = {}
    for path in sorted(p for p in root.rglob("*") if p.suffix in (".cc", ".h")):
        for name, number in types_of(path):
            place = f"{path.relative_to(tree)}:{number}"
            if name in first:
                yield f"{place}: {name} is also a type of {first[name]}"
            first.setdefault(name, place)
    for layer in sorted(path for path in root.iterdir() if path.is_dir()):
        for sources in united(layer):
            yield from hidden_numbers(layer, sources)
            yield from clashes(sources, names_of_source)
        yield from clashes(tests(layer), names_of_test)
        yield from leaks(tests(layer))


def main():
    here = pathlib.Path(__file__).resolve().parent.parent
    tree = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else here
    if not (tree / "src" / "understory").is_dir():
        print(f"check_names.py: {tree} has no src/understory", file=sys.stderr)
        return 2
    pairs = list(check(tree))
    print("\n".join(pairs) if pairs else "names: each has one meaning")
    return 1 if pairs else 0


if __name__ == "__main__":
    sys.exit(main())
