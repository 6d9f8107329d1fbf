#!/usr/bin/env python3
"""Fails where a sentence of a comment or of a message has more than 25 words.

It reads the comments of all C++, Python, shell and CMake, and the docstrings of Python. Messages are the
strings of the program's C++, but for those of its tests. Tags and the parts of a format are no words. Lines that
follow each other at one column are one text. A sentence ends at a full stop, exclamation or question
mark, and at an empty line or an item of a list. So it does where an indented line begins, such as a
parameter or an example of a command. Of a line with columns, the last one counts.
A word has a letter, and what stands in backticks is one word. A source in square brackets at the end
is a sentence of its own.

    check_comments.py [SOURCE_TREE]      exit 0: in order; 1: prints each finding; 2: no such tree
"""

import ast
import pathlib
import re
import sys

MOST_WORDS = 25
FOLDERS = ("src", "benchmarks", "fuzz", "tests", "tools", "packaging", "cmake", ".ci")
MARKS = {".h": "//", ".cc": "//", ".py": "#", ".sh": "#", ".cmake": "#", ".txt": "#", "": "#"}

STRING = r'"(?:\\.|[^"\\])*"|(?<![0-9A-Za-z_])\'(?:\\.|[^\'\\])*\''  # its marks begin no comment
TEXTS = re.compile(r"//[^\n]*|/\*.*?\*/|R\"([^(\s]*)\(.*?\)\1\"|'(?:\\.|[^'\\\n])'"
                   r'|(?P<text>(?:"(?:\\.|[^"\\\n])*"\s*)+)', re.DOTALL)
ITEM = re.compile(r"[-*] |\d+[.)] |\|")
INDENTED = 3  # spaces
ENDED = re.compile(r"(?<=[.!?])[)\"']*\s+|(?<=\S)\s+(?=\[[^\[\]]*\]$)")


def comment_of(line, mark):
    """(column, text after the mark) of the comment of a line, None where it has none."""
    for found in re.finditer(rf"{STRING}|(?<!\S){re.escape(mark)}+<?(.*)$", line):
        if found.group(1) is not None:
            return found.start(), found.group(1)
    return None


def gathered(lines):
    """(first line, last line, text) of each paragraph of lines (number, column, text). A column of None
    ends one, and so does a line that does not continue the one before."""
    first, parts, before, indent = 0, [], None, 0
    for number, column, text in [*lines, (0, None, "")]:
        plain = text.strip()
        depth = len(text) - len(text.lstrip())
        follows = depth < INDENTED if indent < INDENTED else depth > indent
        joins = parts and plain and column == before and follows and not ITEM.match(plain)
        if parts and not joins:
            yield first, first + len(parts) - 1, " ".join(parts)
            parts = []
        if plain and column is not None:
            if not joins:
                first, before, indent = number, column, depth
            parts.append(re.split(r" {3,}", plain)[-1])


def comments_of(lines, mark):
    """The paragraphs of a file's comments."""
    found = []
    for number, line in enumerate(lines, 1):
        comment = comment_of(line, mark)
        if comment is None or line.startswith("#!"):
            found.append((number, None, ""))
            continue
        if line[:comment[0]].strip():
            found.append((number, None, ""))  # a comment behind code begins anew
        found.append((number, *comment))
    return gathered(found)


def docstrings_of(text):
    """The paragraphs of Python's docstrings, without examples."""
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) or not ast.get_docstring(node):
            continue
        lines = node.body[0].value.value.splitlines()
        first, column = node.body[0].lineno, node.body[0].col_offset
        found = []
        for number, line in enumerate(lines, first):
            line = line if number == first else line[column:]
            is_example = line.startswith("  ")
            found.append((number, None, "") if is_example else (number, 0, line))
        yield from gathered(found)


def messages_of(text):
    """(first line, last line, text) of each line of a message of C++; adjacent strings are one."""
    for found in TEXTS.finditer(text):
        if found["text"] is None:
            continue
        first, last = (text.count("\n", 0, place) + 1 for place in (found.start(), found.end()))
        whole = "".join(re.findall(r'"((?:\\.|[^"\\\n])*)"', found["text"]))
        for line in re.split(r"\\n|<[^>]*>", whole):
            yield first, last, re.sub(r"\{[^{}]*\}", "0", line)


def words_of(sentence):
    plain = re.sub(r"`[^`]*`", "x", sentence)
    return [word for word in plain.split() if re.search(r"[A-Za-z]", word)]


def long_sentences(paragraph):
    """The sentences of a paragraph that are too long."""
    return [sentence for sentence in ENDED.split(paragraph) if len(words_of(sentence)) > MOST_WORDS]


def files_of(tree):
    """Every file whose comments are looked at."""
    for path in sorted(path for folder in FOLDERS for path in (tree / folder).rglob("*")):
        is_text = path.suffix != ".txt" or path.name == "CMakeLists.txt"
        if path.suffix in MARKS and is_text and path.is_file() and "corpus" not in path.parts:
            yield path
    yield from (path for path in (tree / "run", tree / "CMakeLists.txt") if path.is_file())


def check(tree):
    """(path, first line, last line, paragraph, sentence) of each sentence that is too long."""
    for path in files_of(tree):
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        found = list(comments_of(text.splitlines(), MARKS[path.suffix]))
        if path.suffix == ".py":
            found += docstrings_of(text)
        if path.is_relative_to(tree / "src") and path.suffix in (".h", ".cc") and "test" not in path.stem:
            found += messages_of(text)
        for first, last, paragraph in found:
            for sentence in long_sentences(paragraph):
                yield path, first, last, paragraph, sentence


def main():
    here = pathlib.Path(__file__).resolve().parent.parent
    tree = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else here
    if not (tree / "src" / "understory").is_dir():
        print(f"check_comments.py: {tree} has no src/understory", file=sys.stderr)
        return 2
    found = [f"{path.relative_to(tree)}:{first}: {len(words_of(sentence))} words: {sentence}"
             for path, first, _, _, sentence in check(tree)]
    print("\n".join(found) if found else f"comments and messages: no sentence has more than {MOST_WORDS} words")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
