#!/usr/bin/env python3
"""Tests of check_docstrings.py on small source trees made for the purpose."""

import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import check_docstrings  # noqa: E402


def findings(text, name="a/one.h"):
    """Names of what has no comment."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "src" / "understory" / name
        path.parent.mkdir(parents=True)
        path.write_text("#pragma once\n\nnamespace u {\n\n" + text + "\n\n}  // namespace u\n")
        return [line.split(": ")[1].split()[0]
                for line in check_docstrings.check(pathlib.Path(folder))]


class CheckDocstrings(unittest.TestCase):
    def test_types_and_free_functions_need_a_comment(self):
        self.assertEqual(findings("struct A {\n};\n\nclass B final : public A {\n};\n\n"
                                  "enum class C { kOne };\n\n[[nodiscard]] int f(int a);\n\n"
                                  "template <typename T>\nT g(T t) {\n  return t;\n}\n\n"
                                  "inline std::vector<int> h() {\n  return {};\n}"),
                         ["A", "B", "C", "f", "g", "h"])

    def test_one_above_or_on_the_line_is_enough(self):
        self.assertEqual(findings("// A thing.\nstruct A {\n};\n\nint f(int a);  // twice a\n\n"
                                  "// Of any type.\ntemplate <typename T>\nT g(T t);"), [])

    def test_one_above_the_first_of_a_group_holds_to_the_next_empty_line(self):
        self.assertEqual(findings("// To bytes and back.\nvoid put(int a);\nint get();\n\nint h();"),
                         ["h"])

    def test_the_comment_of_a_member_is_none_of_the_next_declaration(self):
        self.assertEqual(findings("// A thing.\nstruct A {\n  int a;  // metres\n\n};\n\nint f();"),
                         ["f"])

    def test_members_operators_forward_declarations_and_describe_need_none(self):
        self.assertEqual(findings("class B;\n\n// A thing.\nstruct A {\n  int f();\n\n"
                                  "  struct Inner {\n  };\n};\n\nA operator+(A a, A b);\n\n"
                                  "void describe(ConfigTable& table, A& config);\n\n"
                                  "using C = std::function<void(int)>;\n\n"
                                  "constexpr int kMost = most(3);\n\n"
                                  "inline int A::f() {\n  return 1;\n}"), [])

    def test_headers_of_tests_and_details_need_none(self):
        self.assertEqual(findings("int f();", "a/test_one.h"), [])
        self.assertEqual(findings("int f();", "a/one_test_support.h"), [])
        self.assertEqual(findings("namespace detail {\nint f();\n}\n\nint g();"), ["g"])

    def test_a_number_of_a_table_says_where_it_comes_from(self):
        table = ("// m: edge of a cell [chosen]\ninline constexpr double kCell = 1.0;\n"
                 "// m: edge of a patch\ninline constexpr double kPatch = 2.0;")
        self.assertEqual(findings(table, "a/a_constants.h"), ["kPatch"])
        self.assertEqual(findings(table, "a/other.h"), [])

    def test_words_in_comments_and_strings_are_no_declarations(self):
        self.assertEqual(findings('// struct A {\n// };\n\n// int f();\nconst char* const kText = "int g();";'),
                         [])


if __name__ == "__main__":
    unittest.main()
