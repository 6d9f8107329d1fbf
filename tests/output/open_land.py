"""In open land few points lie near breast height, as hardly anything stands there. The remark says so, and does not call
the cloud of a dense lidar too thin to see stems. Nor are its scans called sparse."""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program, simulated

cases = Cases()
BARE = [f"stand.{kind}_per_ha=0" for kind in ("seedlings", "shrubs", "ground_plants", "stumps", "logs")]
FEW = "too few to see stems reliably"


def mapped(folder, trees_per_ha, *settings):
    walk = simulated("handheld", 5, 12, f"stand.trees_per_ha={trees_per_ha}", *BARE, *settings)
    done = program("map", walk, "-o", folder / "run")
    told = json.loads((folder / "run" / "run.json").read_text())
    remarks = [warning["message"] for warning in told["warnings"] if warning["key"] == "inventory"]
    return done, told, " ".join(remarks)


@cases.case("few trees in the open, by 128 rings")
def few(folder):
    done, told, remarks = mapped(folder, 8)
    assert done.returncode == 0 and told["status"] == "complete", done
    assert "as hardly anything stands there" in remarks and FEW not in remarks, remarks
    assert not told["evidence"]["few_points_near_breast"]
    whys = {change["why"] for change in told["adapted"]}
    assert whys and all("of 128 rings" in why and "sparse scans" not in why for why in whys), whys
    assert told["quality"]["thin_coverage_share"] > 0.0
    return remarks


@cases.case("few trees in the open, by 16 rings")
def rings(folder):
    done, told, remarks = mapped(folder, 8, "lidar.model=VLP-16")
    assert "as hardly anything stands there" in remarks and FEW not in remarks, remarks
    assert any("of 16 rings" in change["why"] for change in told["adapted"]), told["adapted"]


@cases.case("a stand by 128 rings is no open land")
def stand(folder):
    done, told, remarks = mapped(folder, 750)
    assert done.returncode == 0 and told["counts"]["trees"] > 100, done
    assert "hardly anything" not in remarks and not told["adapted"], (remarks, told["adapted"])


cases.run()
