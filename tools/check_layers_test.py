#!/usr/bin/env python3
"""Tests of check_layers.py on small source trees made for the purpose."""

import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import check_layers  # noqa: E402


def findings(files):
    """What the script says about a tree with the layers util, geometry, cli and these files."""
    with tempfile.TemporaryDirectory() as folder:
        tree = pathlib.Path(folder)
        (tree / "CMakeLists.txt").write_text("foreach(layer IN ITEMS\n    util geometry cli)\n")
        for name, text in files.items():
            path = tree / name if name.startswith("fuzz/") else tree / "src" / "understory" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return list(check_layers.check(tree))


class CheckLayers(unittest.TestCase):
    def test_upwards_and_sideways_is_in_order(self):
        self.assertEqual(findings({
            "util/a.h": "#include <vector>\n",
            "geometry/b.h": '#include "understory/util/a.h"\n',
            "geometry/c.cc": '#include "understory/geometry/b.h"\n#include <Eigen/Core>\n',
        }), [])

    def test_downwards_is_an_error_with_its_place(self):
        found = findings({"util/a.h": '// first\n#include "understory/geometry/b.h"\n'})
        self.assertEqual(len(found), 1)
        self.assertIn("src/understory/util/a.h:2", found[0])
        self.assertIn("util stands above geometry", found[0])

    def test_spaces_in_the_directive_hide_nothing(self):
        self.assertEqual(len(findings({"util/a.h": '  #  include "understory/cli/x.h"\n'})), 1)

    def test_relative_and_unknown_paths_are_errors(self):
        found = findings({"util/a.cc": '#include "a.h"\n#include "understory/viewer/x.h"\n'})
        self.assertEqual(len(found), 2)

    def test_folder_that_is_no_layer_is_an_error(self):
        self.assertEqual(len(findings({"helpers/a.h": ""})), 1)

    def test_large_folders_and_files_and_names_twice_are_errors(self):
        few = {f"util/f{i}.cc": "" for i in range(40)}
        self.assertEqual(findings({**few, "util/files/a.h": "x\n" * 500}), [])
        found = findings({**few, "util/f40.cc": "", "geometry/a.h": "x\n" * 501, "cli/a.h": ""})
        self.assertEqual(len(found), 3)
        self.assertIn("geometry/a.h:1: 501 lines", "\n".join(found))
        self.assertIn("src/understory/cli/a.h has this name, too", "\n".join(found))
        self.assertIn("src/understory/util: 41 files", "\n".join(found))

    def test_a_fuzz_target_has_the_files_of_what_its_single_files_include(self):
        files = {"util/a.h": "", "util/a.cc": "", "cli/only.h": "", "cli/other.h": "", "cli/other.cc": "",
                 "cli/one.cc": '#include "understory/util/a.h"\n#include "understory/cli/only.h"\n'
                               '#include "understory/cli/other.h"\n'}
        target = "understory_fuzz(x SOURCE x_fuzz.cc LAYERS util ALONE cli/one.cc{})\n"
        found = findings({**files, "fuzz/CMakeLists.txt": target.format("")})
        self.assertEqual(len(found), 1)
        self.assertIn("x: cli/one.cc needs cli/other.cc", found[0])
        self.assertEqual(findings({**files, "fuzz/CMakeLists.txt": target.format("\n  cli/other.cc")}), [])

    def test_the_project_itself_has_a_readable_order(self):
        here = pathlib.Path(__file__).resolve().parent.parent
        order = check_layers.layer_order(here)
        self.assertEqual((order[0], order[-1]), ("util", "cli"))


if __name__ == "__main__":
    unittest.main()
