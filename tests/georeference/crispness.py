"""A map stays crisp when bad positions by satellites enter its graph: bursts and jumps on, its cloud has the entropy of
the cloud without them, and its path the error."""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import Cases, program

cases = Cases()
MOST_NATS = 0.02
MOST_APE = (1.05, 0.001)  # times that without positions, and metres more
SITE = ("lidar.model=VLP-16", "gnss.jump_interval_s=10", "gnss.jump_m=10", "gnss.burst_interval_s=15", "gnss.burst_m=10")


def answer(*words):
    done = program(*words, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@cases.case("with bursts and jumps fused, the cloud is as crisp and the path as good as without positions")
def crisp(folder):
    walk = folder / "walk.mcap"
    settings = [word for setting in SITE for word in ("--set", setting)]
    done = program("simulate", "demo", "-o", walk, "--seed", 7, "--duration-s", 40, *settings)
    assert done.returncode == 0, done.stderr
    entropy, ape = {}, {}
    for use in ("georeference", "fuse"):
        run = folder / use
        done = program("map", walk, "-o", run, "--set", f"gnss.use={use}")
        assert done.returncode in (0, 4), done.stderr
        entropy[use] = answer("evaluate", "map", run)["mean_entropy_nats"]
        ape[use] = answer("evaluate", run, folder / "walk.truth", "--align", "se3")["ape_rmse_m"]
    print(entropy, ape)
    assert abs(entropy["fuse"] - entropy["georeference"]) <= MOST_NATS, entropy
    assert ape["fuse"] <= MOST_APE[0] * ape["georeference"] + MOST_APE[1], ape


@cases.case("a folder without a cloud is named")
def no_cloud(folder):
    done = program("evaluate", "map", folder)
    assert done.returncode == 3 and "map.laz" in done.stderr, done.stderr


if __name__ == "__main__":
    sys.exit(cases.run())
