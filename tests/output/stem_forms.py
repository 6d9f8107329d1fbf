"""What a full inventory tells of the form of stems: forks, snags, sweep, and stems that share a foot. A simulated stand with
many forked and broken trees is mapped, and its list is compared with the truth."""

import sqlite3
import tempfile
from pathlib import Path

import numpy as np

from full_inventory import number, pairs, rows, run
from program import simulated


def forks(matched):
    """Of the forks below the crown: found, all. Trees without one that got one. Errors of the heights."""
    found, forked, wrong, errors = 0, 0, 0, []
    for tree, grown in matched:
        told, true = number(tree["fork_m"]), number(grown["fork_m"])
        if np.isnan(true):
            wrong += np.isfinite(told)
            continue
        if true < number(grown["crown_base_m"]):
            forked += 1
            found += np.isfinite(told)
        if np.isfinite(told):
            errors.append(told - true)
    return found, forked, wrong, errors


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        walk = simulated("handheld", 6, 16, "gnss.enabled=false", "stand.size_x_m=70", "stand.size_y_m=70", "carrier.length_m=150",
                         "stand.fork_share=0.3", "stand.broken_share=0.15")
        truth = walk.with_suffix(".truth")
        run("map", walk, "-o", folder / "run", "--inventory", "full")
        listed = rows(folder / "run/trees.csv")
        matched = list(pairs(folder / "run", truth))
        found, forked, wrong, errors = forks(matched)
        print(f"{found} of {forked} forks below the crown, {wrong} where there is none, of {len(matched)} trees; "
              f"heights {np.round(errors, 2)} m")
        assert forked >= 5 and found > 0.5 * forked, (found, forked)
        assert wrong <= 1, wrong
        assert abs(np.median(errors)) < 0.4, errors

        snags = [(number(tree["snag"]), number(grown["snag"])) for tree, grown in matched]
        told = [true for said, true in snags if said == 1.0]
        print(f"{len(told)} of {sum(true for _, true in snags):.0f} snags")
        assert len(told) >= 2 and all(true == 1.0 for true in told), snags
        assert sum(said == 0.0 and true == 0.0 for said, true in snags) > 0.8 * sum(true == 0.0 for _, true in snags), snags

        sweep = [(number(tree["sweep_m"]), number(grown["sweep_m"])) for tree, grown in matched]
        off = np.array([said - true for said, true in sweep if np.isfinite(said)])
        print(f"sweep of {len(off)} stems: bias {100 * off.mean():.1f}, RMSE {100 * np.sqrt((off ** 2).mean()):.1f} cm")
        assert len(off) >= 5 and abs(off.mean()) < 0.01 and np.sqrt((off ** 2).mean()) < 0.02, off

        by_id = {int(row["id"]): row for row in listed}
        for row in listed:
            foot = by_id[int(row["foot_id"])]
            assert foot["foot_id"] == foot["id"], (row, foot)
            assert number(foot["dbh_m"]) >= number(row["dbh_m"]), (row, foot)
        # Stems that share a foot are of one forked tree.
        of_tree = {int(tree["id"]): grown for tree, grown in matched}
        for tree, grown in matched:
            if tree["foot_id"] != tree["id"]:
                assert grown["fork_m"] and of_tree.get(int(tree["foot_id"]), grown) is grown, (tree, grown)

        with sqlite3.connect(folder / "run/trees.gpkg") as layer:
            count = layer.execute("select count(*) from trees where fork_m > 0 and sweep_m is not null").fetchone()[0]
        assert count > 0
        assert "forks at, m" in (folder / "run/report.html").read_text()

        # A list of stems alone knows nothing of it, and says so.
        run("inventory", folder / "run/map.laz", "-o", folder / "basic", "--set", "extent=basic")
        for column in ("fork_m", "sweep_m", "foot_id", "snag"):
            assert all(row[column] == "" for row in rows(folder / "basic/trees.csv")), column


if __name__ == "__main__":
    main()
