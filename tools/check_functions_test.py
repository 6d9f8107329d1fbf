#!/usr/bin/env python3
"""Tests of check_functions.py on small source trees made for the purpose."""

import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import check_functions  # noqa: E402


def findings(text, name="a/one.cc"):
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "src" / "understory" / name
        path.parent.mkdir(parents=True)
        path.write_text(text)
        return list(check_functions.check(pathlib.Path(folder)))


def functions(text):
    return [(name, lines, parameters)
            for name, _, lines, parameters in check_functions.functions_of(text)]


def body(lines):
    return "\n".join(["{", *["  work();"] * (lines - 2), "}"])


class CheckFunctions(unittest.TestCase):
    def test_sixty_lines_are_in_order_and_one_more_is_an_error_with_its_place(self):
        self.assertEqual(findings("void f() " + body(60)), [])
        found = findings("namespace u {\n\nvoid f() " + body(61) + "\n}\n")
        self.assertEqual(found, ["src/understory/a/one.cc:3: f has 61 lines; at most 60"])

    def test_a_signature_counts_from_its_first_line(self):
        self.assertEqual(functions("int\nf(int a,\n  int b)\n{\n}"), [("f", 5, 2)])

    def test_seven_parameters_are_in_order_and_one_more_is_an_error(self):
        seven = ", ".join(f"int p{i}" for i in range(7))
        self.assertEqual(findings(f"void f({seven}) {{}}"), [])
        self.assertEqual(findings(f"void f({seven}, int more) {{}}"),
                         ["src/understory/a/one.cc:1: f has 8 parameters; at most 7"])

    def test_commas_within_a_parameter_are_none_between_parameters(self):
        self.assertEqual(functions(
            "void f(std::map<int, std::pair<int, int>> a, std::function<void(int, int)> b,\n"
            "       int c = g(1, 2), Point d = {1, 2}) {}"), [("f", 2, 4)])

    def test_an_override_may_have_those_of_its_base(self):
        eight = ", ".join(f"int p{i}" for i in range(8))
        self.assertEqual(findings(f"class A : B {{\n  void f({eight}) const override {{}}\n}};"), [])

    def test_members_constructors_templates_and_operators_are_functions(self):
        self.assertEqual(functions(
            "class A {\n public:\n  explicit A(int a) : a_{a}, b_(a) {}\n"
            "  int get() const { return a_; }\n"
            "  bool operator()(int a, int b) const { return a < b; }\n"
            "  bool operator==(const A& other) const { return a_ == other.a_; }\n"
            "  int a_{};\n};\n"
            "template <typename T = int>\nauto of(T t) -> std::vector<T> {\n  return {t};\n}\n"
            "A::~A() {}\n"),
            [("A", 1, 1), ("get", 1, 0), ("operator()", 1, 2), ("operator==", 1, 1),
             ("of", 4, 1), ("A::~A", 1, 0)])

    def test_lambdas_belong_to_their_function_and_initialisers_are_none(self):
        self.assertEqual(functions(
            "const std::vector<int> kList = {f(1), f(2)};\n"
            "void f() {\n  g([](int a, int b, int c, int d, int e, int f, int g, int h) {\n"
            "    return a;\n  });\n  for (int i : {1, 2}) {\n  }\n}\n"
            "struct B {\n  int x = 1;\n  std::array<int, 2> y{1, 2};\n};\n"), [("f", 7, 0)])

    def test_braces_in_comments_strings_and_macros_do_not_count(self):
        self.assertEqual(functions(
            "// {\n/* } */ void f() {\n  g(\"}\", '}', R\"(}\")\", 1'000);\n}\n"
            "#define X { \\\n  {\nvoid h() {}\n"), [("f", 3, 0), ("h", 1, 0)])

    def test_a_call_that_another_function_replaces_is_an_error_but_in_its_home_and_in_comments(self):
        call = "// std::stable_sort(a)\nvoid f() {\n  std::stable_sort(a.begin(), a.end());\n}\n"
        self.assertEqual(len(findings(call)), 1)
        self.assertTrue(findings(call)[0].startswith("src/understory/a/one.cc:3: std::stable_sort: "))
        self.assertEqual(findings(call, "util/stable_sort.h"), [])


if __name__ == "__main__":
    unittest.main()
