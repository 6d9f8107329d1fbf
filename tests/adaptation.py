"""What is adapted to a sensor is told in run.json and by --print-config, and what the user set stays."""

import json
import pathlib
import re
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "bad_input"))
from program import Cases, good_recording, map_recording, program

cases = Cases()
RECORDING, _, _ = good_recording(seconds=5)
VOXEL = "preprocess.voxel.voxel_size_m"
SETTINGS = ("--set", f"{VOXEL}=0.4", "--set", "registration.ndt.volume_weight=0.03")


def flat(config, path=""):
    """{"a.b": value} of a configuration in run.json."""
    keys = {}
    for name, value in config.items():
        keys |= flat(value, f"{path}{name}.") if isinstance(value, dict) else {path + name: value}
    return keys


def printed(*options):
    """Of --print-config: {key: (value, comment)}, and its first line."""
    done = program("map", *options, "--print-config")
    assert done.returncode == 0, done.stderr
    path, keys = [], {}
    for line in done.stdout.splitlines():
        if found := re.match(r"( *)(\w+):(?: ([^#]*)(?:# (.*))?)?$", line):
            path = path[:len(found[1]) // 2] + [found[2]]
            if found[3]:
                keys[".".join(path)] = (found[3].strip(), found[4])
    return keys, done.stdout.splitlines()[0]


def same(value, text):
    if isinstance(value, bool) or isinstance(value, str):
        return str(value).lower() == text.strip('"').lower()
    if isinstance(value, list):
        return value == [float(word) for word in text.strip("[]").split(",") if word]
    return float(text) == value


def changes(run):
    return {change["key"]: change for change in run["adapted"]}


@cases.case("sparse scans are adapted to and run.json says so")
def _(folder):
    run = map_recording(RECORDING, folder / "run").run
    asked, ran = flat(run["config"]), flat(run["effective_config"])
    told = changes(run)
    assert asked[VOXEL] == 0.4 and ran[VOXEL] == 0.1, (asked[VOXEL], ran[VOXEL])
    assert (told[VOXEL]["from"], told[VOXEL]["to"], told[VOXEL]["when_s"]) == (0.4, 0.1, 0)
    assert "points a scan of 16 rings, fewer than run.sparse_scan_points (60000)" in told[VOXEL]["why"], told[VOXEL]
    assert {key for key in asked if asked[key] != ran[key]} == set(told)
    assert all(asked[key] == told[key]["from"] and ran[key] == told[key]["to"] for key in told)
    assert run["config_origins"] == {"map.enabled": "--set"}, run["config_origins"]
    report = (folder / "run" / "report.html").read_text()
    assert f"<td>{VOXEL}</td>" in report, "the report does not say what was adapted"
    return f"{len(told)} keys"


@cases.case("what the user set stays and has an effect")
def _(folder):
    plain = map_recording(RECORDING, folder / "plain")
    for name, options in {"settings": SETTINGS, "file": ("--config", folder / "own.yaml")}.items():
        (folder / "own.yaml").write_text("preprocess: {voxel: {voxel_size_m: 0.4}}\n"
                                         "registration: {ndt: {volume_weight: 0.03}}\n")
        own = map_recording(RECORDING, folder / name, *options)
        ran = flat(own.run["effective_config"])
        assert ran[VOXEL] == 0.4 and ran["registration.ndt.volume_weight"] == 0.03, name
        assert not {VOXEL, "registration.ndt.volume_weight"} & set(changes(own.run)), name
        assert "keyframe.distance_m" in changes(own.run), "what nobody set is not adapted any more"
        assert own.run["config_origins"][VOXEL] == ("--set" if name == "settings" else str(options[1]))
        assert own.poses != plain.poses, "the setting has had no effect"


@cases.case("a profile stays")
def _(folder):
    run = map_recording(RECORDING, folder / "run", "--profile", "paper").run
    asked, ran = flat(run["config"]), flat(run["effective_config"])
    by_profile = [key for key, origin in run["config_origins"].items() if origin == "profile paper"]
    assert len(by_profile) > 20 and all(asked[key] == ran[key] for key in by_profile)
    assert ran["keyframe.distance_m"] == 0.2 and ran["preprocess.voxel.voxel_size_m"] == 0.4


@cases.case("an IMU left out is a change, with its time")
def _(folder):
    run = map_recording(RECORDING, folder / "run", "--set", "motion.imu_enabled=false").run
    told = changes(run)
    assert told["registration.ndt.cell_sizes_m"]["to"] == [2, 1, 0.5], told
    assert "switched off" in told["registration.ndt.cell_sizes_m"]["why"]


@cases.case("print-config of a recording is what runs on it")
def _(folder):
    for front_end in ("dense", "sparse"):
        for recording in (RECORDING, "sim:lieksa2?seed=4&duration_s=3"):
            options = (recording, "--front-end", front_end)
            keys, head = printed(*options)
            assert head.startswith("# lidar: ") and "16 rings" in head, head
            extra = () if front_end == "sparse" else ("--set", "map.enabled=false")
            done = program("map", *options, "-o", folder / "run", "--overwrite", *extra)
            assert done.returncode in (0, 4), done.stderr
            run = json.loads((folder / "run" / "run.json").read_text())
            if str(recording).startswith("sim:"):  # the simulator behind the look ahead still tells the truth
                assert (folder / "run.truth" / "trajectory.tum").exists()
                assert front_end == "sparse" or "ape_rmse_m" in run["quality"], run["quality"]
            ran = flat(run["effective_config"])
            wrong = {key: (value, keys.get(key)) for key, value in ran.items()
                     if key != "map.enabled" and not same(value, keys[key][0])}
            assert not wrong and set(ran) == set(keys), wrong
            for key, change in changes(run).items():
                assert keys[key][1].startswith("adapted from "), (key, keys[key])
    keys, _ = printed(RECORDING, *SETTINGS)
    assert keys[VOXEL][0] == "0.4" and keys[VOXEL][1].startswith("set by --set"), keys[VOXEL]
    assert keys["keyframe.distance_m"][0] == "0.3"
    keys, head = printed()
    assert keys[VOXEL][0] == "0.4" and not head.startswith("#")
    missing = program("map", folder / "none.mcap", "--print-config")
    assert missing.returncode == 3, missing.stderr


@cases.case("realtime's own settings are told, and give way to the user's")
def _(folder):
    keys, _ = printed("--realtime")
    assert keys["time_repair.window_s"][0] == "0" and "--realtime" in keys["time_repair.window_s"][1]
    keys, _ = printed("--realtime", "--front-end", "sparse")
    assert keys["stems.pace.longest_gap_s"][0] == "0"
    (folder / "own.yaml").write_text("time_repair: {window_s: 0.25}\n")
    keys, _ = printed("--realtime", "--config", folder / "own.yaml")
    assert keys["time_repair.window_s"][0] == "0.25", keys["time_repair.window_s"]
    run = map_recording(RECORDING, folder / "run", "--realtime").run
    assert changes(run)["time_repair.window_s"]["to"] == 0


cases.run()
