"""`understory evaluate trees`: the best matching of large lists, and two epochs of one stand."""

import csv
import json
import math
import random
import sqlite3
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program

cases = Cases()


def stand(count=400, side=60.0, seed=7):
    draw = random.Random(seed)
    trees = []
    while len(trees) < count:
        x, y = draw.uniform(0, side), draw.uniform(0, side)
        if all(math.hypot(x - t[0], y - t[1]) > 1.2 for t in trees):
            trees.append((x, y, draw.uniform(0.1, 0.4)))
    return trees


def write(path, trees, seed):
    draw = random.Random(seed)
    lines = ["id,x,y,dbh_m,dbh_sd_m,height_m"]
    for k, (x, y, d) in enumerate(trees):
        lines.append(f"{k + 1},{x + draw.gauss(0, 0.03):.3f},{y + draw.gauss(0, 0.03):.3f},"
                     f"{d + draw.gauss(0, 0.004):.4f},0.004,{12 + 30 * d + draw.gauss(0, 0.3):.2f}")
    path.write_text("\n".join(lines) + "\n")
    return path


def later(trees):
    """Every tenth tree of the middle gone, the others 3 cm thicker, and one that grew in."""
    kept = [(x, y, d + 0.03) for k, (x, y, d) in enumerate(trees)
            if not (k % 10 == 0 and 10 < x < 50 and 10 < y < 50)]
    return kept + [(30.05, 30.05, 0.07)]


def compared(*words, expected=0):
    done = program("evaluate", "trees", *words)
    assert done.returncode == expected, done
    return done


@cases.case("gone, new and grown, on the terminal, as JSON and as files")
def changes(folder):
    trees = stand()
    old, new = write(folder / "old.csv", trees, 1), write(folder / "new.csv", later(trees), 2)
    told = json.loads(compared(old, new, "--epochs", "--json").stdout)
    assert told["gone"] == len(trees) + 1 - len(later(trees)) and told["new"] == 1, told
    assert told["missed_before"] == 0 and abs(told["dbh_increment_m"]["mean"] - 0.03) < 0.001, told
    assert told["dbh_increment_m"]["grown"] > 0.9 * told["stays"], told
    said = compared(old, new, "--epochs", "-o", folder / "changes.csv").stdout
    assert "convex hull" in said and "1.96 sd" in said, said
    rows = list(csv.DictReader((folder / "changes.csv").open()))
    assert sum(row["change"] == "gone" for row in rows) == told["gone"]
    assert all(row["id_new"] == "" for row in rows if row["change"] == "gone")
    compared(old, new, "--epochs", "-o", folder / "changes.gpkg")
    with sqlite3.connect(folder / "changes.gpkg") as package:
        counted = dict(package.execute("select change, count(*) from changes group by change"))
    assert counted == {c: told[c] for c in counted} and counted["gone"] == told["gone"], counted
    return f"{told['gone']} gone, 1 new, {told['dbh_increment_m']['grown']} of {told['stays']} grown"


@cases.case("what one path did not reach is not gone")
def areas(folder):
    trees = stand()
    (folder / "run").mkdir()
    write(folder / "old.csv", trees, 3)
    near = [t for t in trees if t[1] < 12 or t[0] < 12]  # along an L: its hull is the whole triangle
    write(folder / "run" / "trees.csv", near, 4)
    path = [(k, 0) for k in range(61)] + [(0, k) for k in range(61)]
    (folder / "run" / "trajectory.tum").write_text(
        "".join(f"{i}.0 {x} {y} 0 0 0 0 1\n" for i, (x, y) in enumerate(path)))
    told = json.loads(compared(folder / "old.csv", folder / "run", "--epochs", "--json").stdout)
    assert "path" in told["seen_by_new"] and told["gone"] == 0, told
    bare = json.loads(compared(folder / "old.csv", folder / "run" / "trees.csv", "--epochs",
                               "--json").stdout)
    assert bare["gone"] > 50 and "hull" in bare["seen_by_new"], bare
    return f"{told['outside_new']} outside; the hull alone would call {bare['gone']} gone"


@cases.case("two stands, a copy, a shift and a wrong name are refused")
def refused(folder):
    trees = stand()
    old = write(folder / "old.csv", trees, 1)
    other = write(folder / "other.csv", stand(seed=8), 2)
    out = folder / "changes.csv"
    done = compared(old, other, "--epochs", "-o", out, expected=4)
    assert "no more than chance" in done.stderr and "--align" in done.stderr and not out.exists(), done
    few = [write(folder / f"few{k}.csv", stand(60, 25.0, 20 + k), k) for k in range(2)]
    done = compared(*few, "--epochs", "--align", "yaw", expected=4)
    assert "chance" in done.stderr or "one stand" in done.stderr, done
    assert "a copy" in compared(old, old, "--epochs", expected=4).stderr
    turned = [(0.9 * x - 0.43589 * y + 40, 0.43589 * x + 0.9 * y, d) for x, y, d in later(trees)]
    new = write(folder / "turned.csv", turned, 3)
    compared(old, new, "--epochs", expected=4)
    told = json.loads(compared(old, new, "--epochs", "--align", "yaw", "--json").stdout)
    assert told["gone"] == len(trees) + 1 - len(later(trees)), told
    assert "expected a name" in compared(old, new, "--epochs", "-o", folder / "x.txt", expected=2).stderr
    assert "needs --epochs" in compared(old, new, "-o", out, expected=2).stderr
    compared(old, new, "--epochs", "-o", folder / "none" / "x.csv", "--align", "yaw", expected=3)
    assert "which is read" in compared(old, new, "--epochs", "-o", old, expected=3).stderr
    assert old.read_text().startswith("id,x,y")


@cases.case("a diameter of 0, -1 or -9999 is refused by its line, and another unit by its name")
def no_diameters(folder):
    trees = stand(60, 25.0)
    old, new = write(folder / "old.csv", trees, 1), folder / "new.csv"
    for unknown in (0.0, -1.0, -9999.0, 1e6):
        rows = write(new, trees, 2).read_text().splitlines()
        cells = rows[9].split(",")
        rows[9] = ",".join(cells[:3] + [str(unknown)] + cells[4:])
        new.write_text("\n".join(rows) + "\n")
        for words in (("evaluate", "trees", old, new), ("evaluate", "trees", old, new, "--epochs"),
                      ("merge", new, old, "-o", folder / "both")):
            done = program(*words)
            assert done.returncode == 3 and "line 10" in done.stderr, (unknown, done)
            assert "empty cell" in done.stderr and not (folder / "both").exists(), (unknown, done)
    write(new, [(x, y, 100 * d) for x, y, d in trees], 2)
    assert "centimetres" in compared(old, new, "--epochs", expected=4).stderr


@cases.case("a permanent plot that was measured anew is compared, also where trees keep their places")
def permanent_plot(folder):
    rows = [(x, y, d) for x, y, d in stand(100, 35.0)]
    lists = []
    for name, grown in (("old", 0.0), ("new", 0.02)):
        lists.append(folder / f"{name}.csv")
        lists[-1].write_text("x,y,dbh_m,height_m\n" + "".join(
            f"{x:.2f},{y:.2f},{d + grown:.3f},{12 + 30 * d + 50 * grown:.1f}\n" for x, y, d in rows))
    told = json.loads(compared(*lists, "--epochs", "--json").stdout)
    assert told["stays"] == 100 and abs(told["dbh_increment_m"]["mean"] - 0.02) < 1e-9, told
    done = program("merge", *lists, "-o", folder / "both")
    assert done.returncode == 0, done


@cases.case("a list that is one radius off is not called complete")
def misfit(folder):
    trees = stand()
    old = write(folder / "old.csv", trees, 1)
    # Turned about one corner: only trees near it match where they lie.
    turned = [(0.9994 * x - 0.0349 * y, 0.0349 * x + 0.9994 * y, d) for x, y, d in trees]
    done = program("evaluate", "trees", old, write(folder / "new.csv", turned, 2), "--epochs")
    assert done.returncode == 4 and "--align yaw" in done.stderr, done


@cases.case("the best pairs in large lists")
def large(folder):
    draw = random.Random(3)
    trees = [(draw.uniform(0, 450), draw.uniform(0, 450), draw.uniform(0.1, 0.4)) for _ in range(20000)]
    a, b = write(folder / "a.csv", trees, 1), write(folder / "b.csv", trees, 2)
    best = json.loads(compared(a, b, "--json").stdout)
    nearest = json.loads(compared(a, b, "--matching", "nearest", "--json").stdout)
    assert best["matched"] >= nearest["matched"] and best["matched"] > 19990, (best, nearest)
    assert best["dbh_rmse_m"] < nearest["dbh_rmse_m"] - 1e-4, (best["dbh_rmse_m"], nearest["dbh_rmse_m"])
    assert sum(c["matched"] for c in best["by_diameter"]) == best["matched"]
    assert best["overlapping_tree_ratio"] > 0.98, best
    heap = folder / "heap.csv"
    heap.write_text("x,y\n" + "1,2\n" * 5000)
    assert "hold each tree once" in compared(heap, heap, expected=3).stderr
    return f"diameters {1e3 * nearest['dbh_rmse_m']:.2f} mm nearest first, {1e3 * best['dbh_rmse_m']:.2f} mm at best"


cases.run()
