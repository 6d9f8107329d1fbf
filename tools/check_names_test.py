#!/usr/bin/env python3
"""Tests of check_names.py on small source trees made for the purpose."""

import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import check_names  # noqa: E402


def findings(files):
    with tempfile.TemporaryDirectory() as folder:
        tree = pathlib.Path(folder)
        for name, text in files.items():
            path = tree / "src" / "understory" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return list(check_names.check(tree))


def inside(namespace, text):
    return f"namespace {namespace} {{\n{text}\n}}  // namespace {namespace}\n"


class CheckNames(unittest.TestCase):
    def test_one_name_for_two_types_is_an_error_with_both_places(self):
        found = findings({"a/one.h": inside("u", "struct Tree {\n};"),
                          "b/two.h": inside("u", "class Tree final : public Plant {\n};")})
        self.assertEqual(len(found), 1)
        self.assertIn("src/understory/b/two.h:2", found[0])
        self.assertIn("src/understory/a/one.h:2", found[0])

    def test_it_is_one_in_source_files_as_well(self):
        self.assertEqual(len(findings({"a/one.h": inside("u", "struct Tree {"),
                                       "b/two.cc": inside("u", "enum class Tree : int {")})), 1)

    def test_other_namespaces_and_unnamed_ones_are_no_clash(self):
        self.assertEqual(findings({
            "a/one.h": inside("u", "struct Tree {\n};"),
            "b/two.h": inside("u::testing", "struct Tree {\n};"),
            "b/three.cc": "namespace u {\nnamespace {\nstruct Tree {\n};\n}  // namespace\n"
                          "}  // namespace u\n",
        }), [])

    def test_after_an_unnamed_namespace_names_count_again(self):
        self.assertEqual(len(findings({
            "a/one.h": inside("u", "struct Tree {\n};"),
            "b/two.cc": "namespace u {\nnamespace {\n}  // namespace\nstruct Tree {\n};\n"
                        "}  // namespace u\n",
        })), 1)

    def test_declarations_and_members_are_none(self):
        self.assertEqual(findings({
            "a/one.h": inside("u", "struct Tree;\nstruct Tree {\n  struct Tree {\n  };\n};"),
            "b/two.h": inside("u", "class Tree;\nstruct Wood::Tree {\n};"),
        }), [])

    def test_a_constant_that_hides_a_number_of_another_files_table_is_an_error(self):
        table = inside("u::a_constants", inside("one", "// m [chosen]\ninline constexpr double kNear = 1.0;"))
        user = "namespace u {\nnamespace {\n\nusing namespace a_constants::one;\n}\n}\n"
        other = "namespace u {\nnamespace {\nconstexpr double kNear = 2.0;\n}\n}\n"
        files = {"a/a_constants.h": table, "a/one.cc": user, "a/x/two.cc": other}
        self.assertEqual(findings(files), ["one.cc: kNear of its table is also a constant of two.cc"])
        layer = "understory_layer(a\n  SOURCES\n    {}\n  APART\n    {}\n  DEPENDS util)\n"
        for together, alone in (("one.cc", "x/two.cc"), ("x/two.cc", "one.cc")):
            lists = {"a/CMakeLists.txt": layer.format(together, alone)}
            self.assertEqual(findings({**files, **lists}), [])
        lists = {"a/CMakeLists.txt": layer.format("one.cc\n    x/two.cc", "three.cc")}
        self.assertEqual(len(findings({**files, **lists})), 1)
        self.assertEqual(findings({**files, "a/x/two.cc": "", "b/two.cc": other}), [])

    def test_one_name_in_unnamed_namespaces_of_a_layer_is_an_error(self):
        def own(text):
            return f"namespace u {{\nnamespace {{\n{text}\n}}  // namespace\n}}  // namespace u\n"
        for text in ("constexpr double kNear = 1.0;", "class Reader {\n};", "struct Work : Job {\n};"):
            found = findings({"a/one.cc": own(text), "a/x/two.cc": own(text)})
            self.assertEqual(len(found), 1, text)
            self.assertIn("is also a name of one.cc", found[0])
            self.assertEqual(findings({"a/one.cc": own(text), "b/two.cc": own(text)}), [])
            self.assertEqual(findings({"a/one.cc": own(text), "a/one_test.cc": own(text)}), [])
            lists = "understory_layer(a\n  SOURCES\n    one.cc\n  APART\n    x/two.cc\n  DEPENDS util)\n"
            self.assertEqual(findings({"a/one.cc": own(text), "a/x/two.cc": own(text),
                                       "a/CMakeLists.txt": lists}), [])
            # A unit of its own begins behind a `|`.
            for behind, count in (("| two.cc", 0), ("| two.cc one.cc", 1), ("two.cc |", 1), ("| one.cc | two.cc", 0)):
                lists = f"understory_layer(a\n  TOGETHER 9\n  SOURCES three.cc {behind}  # | x\n  DEPENDS util)\n"
                self.assertEqual(len(findings({"a/one.cc": own(text), "a/two.cc": own(text),
                                               "a/CMakeLists.txt": lists})), count, behind)
        local = "int f() {\n  constexpr double kNear = 1.0;\n}"
        self.assertEqual(findings({"a/one.cc": own(local), "a/two.cc": own(local)}), [])

    def test_one_name_in_unnamed_namespaces_of_tests_is_an_error(self):
        def own(text):
            return f"namespace u {{\nnamespace {{\n{text}\n}}  // namespace\n}}  // namespace u\n"

        def of(one, two):
            return findings({"a/one_test.cc": own(one), "a/x/two_test.cc": own(two)})
        walk = "std::vector<Pose> walk(int n) {\n  return {};\n}"
        for text in ("constexpr double kNear = 1.0;", "const Vector3d kArm(1.0, 2.0);", "struct Walk {\n};",
                     "template <int N>\nconst Tree& walk(\n    int n) {\n}", walk):
            self.assertEqual(len(of(text, text)), 1, text)
            self.assertEqual(findings({"a/one_test.cc": own(text), "b/two_test.cc": own(text)}), [])
            self.assertEqual(findings({"a/one_test.cc": own(text), "a/two.cc": own(text)}), [])
        self.assertEqual(of(walk, "int walk() {\n}"), [
            "two_test.cc: walk is also a name of one_test.cc: compiled together they clash"])
        self.assertEqual(of("TEST(Walk, Ends) {\n  walk(1);\n}", walk), [])
        self.assertEqual(of("int far() {\n  const int near = 1;\n}", "int near() {\n}"), [])
        for text in ("using test::walk;", "using walk = test::Walk;", "namespace walk = std::filesystem;"):
            self.assertEqual(of(text, text), [], text)
            self.assertEqual(len(of(text, walk)), 1, text)
            self.assertEqual(len(of(walk, text)), 1, text)
        self.assertEqual(len(of("using walk = int;", "using walk = float;")), 1)
        for text in ("using namespace test;", "#define WALK 1"):
            self.assertEqual(findings({"a/one_test.cc": own(text)}),
                             [f"one_test.cc: `{text}` holds for the tests behind it, too"])


if __name__ == "__main__":
    unittest.main()
