#!/usr/bin/env python3
"""Tests of check_comments.py on small source trees made for the purpose."""

import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import check_comments  # noqa: E402

THIRTEEN = "one two three four five six seven eight nine ten eleven twelve thirteen"
TWELVE = THIRTEEN.removesuffix(" thirteen")


def findings(text, name="src/understory/a/one.h"):
    """(first line, last line, words) of each sentence that is too long."""
    with tempfile.TemporaryDirectory() as folder:
        tree = pathlib.Path(folder)
        path = tree / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return [(first, last, len(check_comments.words_of(sentence)))
                for _, first, last, _, sentence in check_comments.check(tree)]


class CheckComments(unittest.TestCase):
    def test_lines_of_one_comment_are_one_sentence(self):
        self.assertEqual(findings(f"int a;\n// {THIRTEEN}\n// {THIRTEEN}\nint b;\n"), [(2, 3, 26)])
        self.assertEqual(findings(f"// {THIRTEEN}\n// {TWELVE}\n"), [])

    def test_so_are_those_behind_code(self):
        self.assertEqual(findings(f"int a;  // {THIRTEEN}\n        // {THIRTEEN}\n"), [(1, 2, 26)])
        self.assertEqual(findings(f"int a;  // {THIRTEEN}\n// {THIRTEEN}\n"), [])
        self.assertEqual(findings(f"int a;  // {THIRTEEN}\nint b;  // {THIRTEEN}\n"), [])

    def test_marks_empty_lines_and_items_end_a_sentence(self):
        for end in (".", "!", "?", ".)", '."', "\n//\n//", "\n// -", "\n// 1."):
            self.assertEqual(findings(f"// {THIRTEEN}{end} {THIRTEEN}\n"), [], end)
        for within in (",", ":", ";", "\n// and", ".5"):
            self.assertEqual(len(findings(f"// {THIRTEEN}{within} {THIRTEEN}\n")), 1, within)

    def test_indented_lines_are_others(self):
        self.assertEqual(findings(f"// {THIRTEEN}\n//   {THIRTEEN}\n//   {THIRTEEN}\n// {THIRTEEN}\n"), [])
        self.assertEqual(findings(f"//   {THIRTEEN}\n//     {THIRTEEN}\n"), [(1, 2, 26)])
        self.assertEqual(findings(f"//   {THIRTEEN}   {THIRTEEN}\n"), [])

    def test_backticks_are_a_word_and_numbers_none(self):
        self.assertEqual(findings(f"// {THIRTEEN} {TWELVE} 1 + 2 = 3\n"), [])
        self.assertEqual(findings(f"// {THIRTEEN} {TWELVE[4:]} `a b c d`\n"), [])
        self.assertEqual(findings(f"// {THIRTEEN} {TWELVE} `a b c d`\n"), [(1, 1, 26)])

    def test_a_source_is_a_sentence_of_its_own(self):
        self.assertEqual(findings(f"// {THIRTEEN} [{THIRTEEN}]\n"), [])
        self.assertEqual(findings(f"// {THIRTEEN} [{THIRTEEN}] and\n"), [(1, 1, 27)])

    def test_strings_are_no_comments(self):
        self.assertEqual(findings(f'auto a = "a // {THIRTEEN} {THIRTEEN}";\n', "tests/a.cc"), [])
        self.assertEqual(findings(f'auto a = "\\"";  // {THIRTEEN} {THIRTEEN}\n'), [(1, 1, 26)])

    def test_python_has_docstrings_too(self):
        text = f'"""{THIRTEEN}\n{THIRTEEN}\n"""\n'
        self.assertEqual(findings(text, "tools/a.py"), [(1, 2, 26)])
        inner = f'class A:\n    def f(self):\n        """{THIRTEEN}\n        {THIRTEEN}\n\n        {TWELVE}"""\n'
        self.assertEqual(findings(inner, "tests/b/a.py"), [(3, 4, 26)])
        example = f'"""{THIRTEEN}:\n\n  a.py {THIRTEEN} {THIRTEEN}\n"""\n'
        self.assertEqual(findings(example, "benchmarks/a.py"), [])

    def test_strings_of_the_program_are_messages(self):
        name = "src/understory/a/one.cc"
        text = f'f("{THIRTEEN} "\n  "{THIRTEEN}");\n'
        self.assertEqual(findings(text, name), [(1, 2, 26)])
        self.assertEqual(findings(text, "src/understory/a/one_test.cc"), [])
        self.assertEqual(findings(text, "benchmarks/one.cc"), [])
        for end in (". ", "\\n", " <p> ", '", "'):
            self.assertEqual(findings(f'f("{THIRTEEN}{end}{THIRTEEN}");\n', name), [], end)
        self.assertEqual(findings(f'f("{THIRTEEN} {TWELVE} {{:.1f}} {{name}}");\n', name), [])
        self.assertEqual(findings(f"""char a = '"'; f("{THIRTEEN} \\" {THIRTEEN}");\n""", name), [(1, 1, 26)])
        self.assertEqual(findings(f'auto a = R"({THIRTEEN} {THIRTEEN})";\n', name), [])

    def test_shell_and_cmake_have_their_mark(self):
        for name in ("run", ".ci/run", "tools/a.sh", "cmake/A.cmake", "src/understory/CMakeLists.txt"):
            self.assertEqual(findings(f"#!/bin/sh\n# {THIRTEEN} {THIRTEEN}\n", name), [(2, 2, 26)], name)
        self.assertEqual(findings(f"# {THIRTEEN} {THIRTEEN}\n", "tools/packages/list.txt"), [])


if __name__ == "__main__":
    unittest.main()
