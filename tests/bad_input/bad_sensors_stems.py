"""Sensors that fail, through `understory map --front-end sparse`. The stems find out a wrong IMU, and
the recording is mapped as if it had none. Smeared scans are reported."""

import json
import math

from program import Cases, good_recording, program
from recordings import edit_cloud, edit_imu, write_mcap

cases = Cases()
good, messages, truth = good_recording(seconds=16)


def mapped(recording, run, *options):
    done = program("map", recording, "-o", run, "--front-end", "sparse", "--threads", 1, *options)
    told = json.loads((run / "run.json").read_text())
    return done.returncode, told["reasons"], {w["key"] for w in told["warnings"]}


def plane_error_m(run):
    return json.loads(program("evaluate", run, truth, "--align", "se3", "--json").stdout)["ape_plane_rmse_m"]


mapped(good, cases.folder / "without", "--set", "stems.imu.use=false")
WITHOUT = (cases.folder / "without" / "trajectory.tum").read_bytes()


@cases.case("an IMU that is right")
def right(folder):
    code, reasons, warnings = mapped(good, folder / "run")
    assert code == 0 and not reasons and not any(key.startswith("imu.") for key in warnings), reasons
    error = plane_error_m(folder / "run")
    assert error < 0.06 and error < plane_error_m(cases.folder / "without"), error
    return f"{100 * error:.1f} cm"


def both(change):
    """The same change of the axes of rates and forces."""
    return lambda rates, forces: (change(rates), change(forces))


SPOILT = {
    "x and y swapped": (both(lambda v: (v[1], v[0], v[2])), "axes look swapped"),
    "axes cycled": (both(lambda v: (v[2], v[0], v[1])), "axes look swapped"),
    "z of the rates reversed": (lambda w, a: ((w[0], w[1], -w[2]), a), "axes look swapped"),
    "rates in degrees a second": (lambda w, a: ([math.degrees(v) for v in w], a), "degrees per second"),
    "rates off by 0.3 rad/s": (lambda w, a: ([v + 0.3 for v in w], a), "disagree"),
    "forces reversed": (lambda w, a: (w, [-v for v in a]), "gravity"),
}

for name, (change, said) in SPOILT.items():
    @cases.case(name)
    def spoilt(folder, change=change, said=said):
        path = folder / "walk.mcap"
        write_mcap(path, [edit_imu(m, change) if m.topic == "/imu" else m for m in messages])
        code, reasons, warnings = mapped(path, folder / "run")
        assert code == 4 and "imu.untrusted" in warnings, (code, reasons, warnings)
        assert said in reasons[0] and "mapped without the IMU" in reasons[0], reasons
        assert (folder / "run" / "trajectory.tum").read_bytes() == WITHOUT
        return reasons[0][:90]


@cases.case("no time per point")
def no_times(folder):
    path = folder / "walk.mcap"
    write_mcap(path, [edit_cloud(m, lambda cloud: cloud.without("t")) if m.topic == "/lidar" else m
                      for m in messages])
    code, reasons, _ = mapped(path, folder / "run")
    assert code == 4 and any("no time per point" in r and "are smeared by" in r for r in reasons), reasons
    return reasons[0][-60:]


cases.run()
