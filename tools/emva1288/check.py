#!/usr/bin/env python3
"""The simulated sensor, measured by the public emva1288 package: what is put in must come out.

    python3 -m venv /tmp/emva && /tmp/emva/bin/pip install -r tools/emva1288/requirements.txt
    cargo build --release -p shutterbug-tools
    /tmp/emva/bin/python tools/emva1288/check.py

`shutterbug-tools flat-fields` takes the pictures with the chain's own kernels, the package evaluates them. Error bars: the
whole measurement is repeated with other noise and other sensors of the kind; the bar of a result is the standard deviation
over the repetitions, divided by the root of their number, and a result holds if the value put in lies within LIMIT bars of
the mean. Nothing of the simulation enters the bar. Controls: for each value, the wrong one of --wrong percent more must lie
outside; and a sensor that is wrong by so much must be refused. Exit code 0: all of that holds.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from emva1288.process.data import Data1288
from emva1288.process.loader import LoadImageData
from emva1288.process.parser import ParseEmvaDescriptorFile
from emva1288.process.results import Results1288
from PIL import Image

# Three standard errors, as of a normal distribution; with 12 repetitions Student's t gives them 1.2 % by chance.
LIMIT = 3.0

SENSOR = {
    "full_well_e": 10000.0,
    "read_e": 12.0,
    "dsnu_e": 8.0,
    "prnu": 0.01,
    "dark_e_per_s": 2000.0,
    "bits": 12,
    "offset": 0.02,
    "photons_per_electron": 2.0,
}


def camera_toml(sensor, seed, size):
    well = sensor["full_well_e"]
    return f"""width = {size[0]}
height = {size[1]}
fx = 100.0
fy = 100.0
cx = {size[0] / 2}
cy = {size[1] / 2}
frame_period_s = 1.0

[motion_blur]
exposure_time_s = 0.1

[dark_current]
rate_per_s = {sensor["dark_e_per_s"] / well}

[shot_noise]
full_well_e = {well}

[fixed_pattern_noise]
dsnu = {sensor["dsnu_e"] / well}
prnu = {sensor["prnu"]}
sensor_seed = {seed}

[read_noise]
sigma = {sensor["read_e"] / well}

[black_level]
offset = {sensor["offset"]}

[quantization]
bits = {sensor["bits"]}
"""


def put_in(sensor):
    """What the package should find, by its names and in its units."""
    steps = 2 ** sensor["bits"] - 1
    gain = steps * (1.0 - sensor["offset"]) / sensor["full_well_e"]
    return {
        "K": (gain, "DN/e-", "system gain"),
        "full_well": (sensor["full_well_e"], "e-", "full well: the converter's range over K"),
        "QE": (100.0 / sensor["photons_per_electron"], "%", "quantum efficiency"),
        "sigma_d": (sensor["read_e"], "e-", "read noise: temporal dark noise without exposure"),
        "u_I_mean": (sensor["dark_e_per_s"], "e-/s", "dark current from the mean"),
        "u_I_var": (sensor["dark_e_per_s"], "e-/s", "dark current from the variance"),
        "DSNU1288": (sensor["dsnu_e"], "e-", "DSNU"),
        "PRNU1288": (100.0 * sensor["prnu"], "%", "PRNU"),
    }


def measure(tool, sensor, seed, size, args, folder):
    camera = folder / "camera.toml"
    camera.write_text(camera_toml(sensor, seed, size))
    call = [tool, "flat-fields", "--camera", camera, "--out", folder, "--seed", str(1000 + seed)]
    call += ["--steps", str(args.steps), "--series", str(args.series)]
    call += ["--photons-per-electron", str(sensor["photons_per_electron"])]
    subprocess.run([str(c) for c in call], check=True, stdout=subprocess.DEVNULL)
    parsed = ParseEmvaDescriptorFile(str(folder / "descriptor.txt"), loglevel=40)
    # The package's own loader splits channels, which 16-bit pictures do not have.
    loaded = LoadImageData(parsed.images, loglevel=40, fload=lambda f: np.asarray(Image.open(f)))
    results = Results1288(Data1288(loaded.data, loglevel=40).data, loglevel=40)
    found = {name: float(getattr(results, name)) for name in put_in(sensor) if name != "full_well"}
    found["full_well"] = (2 ** sensor["bits"] - 1) * (1.0 - sensor["offset"]) / found["K"]
    return found


def repeat(tool, sensor, args):
    size = [int(s) for s in args.size.split("x")]
    rows = []
    for seed in range(args.repetitions):
        with tempfile.TemporaryDirectory() as folder:
            rows.append(measure(tool, sensor, seed, size, args, pathlib.Path(folder)))
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def judge(values, truth):
    """Mean, error bar and how many bars the truth lies from the mean."""
    mean, bar = values.mean(), values.std(ddof=1) / np.sqrt(len(values))
    return mean, bar, (mean - truth) / bar


def main():
    root = pathlib.Path(__file__).resolve().parents[2]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tool", default=root / "target/release/shutterbug-tools")
    parser.add_argument("--repetitions", type=int, default=12)
    parser.add_argument("--steps", type=int, default=40, help="exposure times")
    parser.add_argument("--series", type=int, default=60, help="pictures of a spatial series")
    parser.add_argument("--size", default="192x128", help="px")
    parser.add_argument("--wrong", type=float, default=10.0, help="percent of the controls")
    parser.add_argument("--json", type=pathlib.Path, help="where to write what was found")
    args = parser.parse_args()
    if not pathlib.Path(args.tool).is_file():
        sys.exit(f"{args.tool} is not there: cargo build --release -p shutterbug-tools, or name it with --tool")
    factor = 1.0 + args.wrong / 100.0
    failed, table = [], {}
    found = repeat(args.tool, SENSOR, args)
    print(f"{args.repetitions} sensors of {args.size} px, {args.steps} exposure times, series of {args.series}")
    print(f"{'':10}{'put in':>11}{'found':>11}{'bar':>9}{'off by':>8}  control, off by")
    for name, (truth, unit, what) in put_in(SENSOR).items():
        mean, bar, off = judge(found[name], truth)
        wrong = judge(found[name], factor * truth)[2]
        print(f"{name:10}{truth:11.4f}{mean:11.4f}{bar:9.4f}{off:8.2f}  {wrong:8.2f}   {what}, {unit}")
        table[name] = {"put_in": truth, "found": mean, "bar": bar, "unit": unit}
        if not abs(off) <= LIMIT:
            failed.append(f"{name}: {mean:.5g} +- {bar:.2g} {unit} for {truth:.5g}")
        if not abs(wrong) > LIMIT:
            failed.append(f"{name}: {args.wrong:g} % more would not be seen")
    other = dict(SENSOR, full_well_e=SENSOR["full_well_e"] * factor, read_e=SENSOR["read_e"] * factor)
    wrong = repeat(args.tool, other, args)
    for name in ("K", "full_well", "sigma_d"):
        off = judge(wrong[name], put_in(SENSOR)[name][0])[2]
        print(f"control: a sensor with {args.wrong:g} % more full well and read noise: {name} off by {off:.1f}")
        if not abs(off) > LIMIT:
            failed.append(f"a wrong sensor passes for the right one by {name}")
    if args.json:
        args.json.write_text(json.dumps(table, indent=2) + "\n")
    for line in failed:
        print("FAILED", line)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
