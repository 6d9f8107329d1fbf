"""The table of all sites (benchmarks/sites.py). Rows that are measured again replace their like, all
others stay, and a row comes out of the program's own figures."""

import sys
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "benchmarks"))

import sites  # noqa: E402


def row(name, seed, part, ape):
    return [name, str(seed), part, "100", ape] + [""] * 6 + ["300", "complete", "0.1.0"]


def check(condition, what):
    if not condition:
        sys.exit(f"site_table: {what}")


def test_record():
    page = Path(tempfile.mkdtemp()) / "results.md"
    page.write_text(f"before\n{sites.BEGIN}\n{sites.END}\nafter\n")
    for new in (row("lake", 21, "whole", "5.0"), row("evo2", 21, "first 180 s", "2.0"),
                row("lieksa1, by stems", 21, "first 180 s", "3.0"),
                row("lieksa1", 21, "first 180 s", "1.0"), row("evo2", 21, "whole", "2.5"),
                row("evo2", 21, "first 180 s", "9.0")):
        sites.write_row(new, page)
    text = page.read_text()
    check(text.startswith("before\n") and text.endswith("\nafter\n"), "the rest of the page stays")
    kept = [(r[0], r[2], r[4]) for r in sites.rows_of(text)]
    check(kept == [("evo2", "first 180 s", "9.0"), ("evo2", "whole", "2.5"),
                   ("lieksa1", "first 180 s", "1.0"), ("lieksa1, by stems", "first 180 s", "3.0"),
                   ("lake", "whole", "5.0")], f"rows are {kept}")


def test_rows_of_a_site():
    check(sites.row_names(["tuusniemi3", "evo1"]) ==
          [("evo1", ""), ("tuusniemi3", ""), ("tuusniemi3", "machine boxes")], "rows of sites")
    shipped = {path.stem for path in (TOP / "configs" / "sites").glob("*.yaml")}
    # Two have the table with floors, one has no lidar, one has two of them, and each seed of `random` is another site.
    others = {"handheld", "harvester", "harvester2", "still", "random"}
    check(set(sites.SITES) == shipped - others, "every shipped site has a row")


def test_measured():
    """A row of a short excerpt, and one of a run that fails."""
    sites.EXCERPT_S = 8
    with tempfile.TemporaryDirectory() as work:
        cells = sites.measure_row(Path(work), "lieksa1", "", 5, whole=False)
        columns = [name.strip() for name in sites.HEAD.split("|")[1:-1]]
        check(len(cells) == len(columns), "one cell a column")
        by_name = dict(zip(columns, cells))
        check(by_name["status"].startswith("complete"), f"status is {by_name['status']}")
        check(0.0 < float(by_name["APE SE(3) cm"]) < 10.0, "an error in centimetres")
        check(float(by_name["memory MB"]) > 20.0 and float(by_name["CPU ms a scan"]) > 0.1, "costs")
        sites.WAYS["broken"] = ["--set", "no.such=1"]
        failed = sites.measure_row(Path(work), "lieksa1", "broken", 5, whole=False)
        check(len(failed) == len(columns) and failed[3] == "" and "no.such" in failed[-2],
              f"a run that fails says so: {failed}")


if __name__ == "__main__":
    test_record()
    test_rows_of_a_site()
    test_measured()
