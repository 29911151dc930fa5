"""Inputs of the chain as `cargo bench --bench chain` wrote them, and the timing of one implementation."""
import json
import sys
import time
from pathlib import Path

import numpy as np

FOLDER = Path(sys.argv[1])
PARAMETERS = json.loads((FOLDER / "parameters.json").read_text())
WIDTH, HEIGHT = PARAMETERS["size"]
MARGIN = PARAMETERS["margin_px"]
SIGMA = PARAMETERS["sigma"]
THREADS = PARAMETERS["threads"]
REPEATS = PARAMETERS["repeats"]


def inputs(motion):
    """Colour (RGBA, 8 bits, linear) and the two motion images, px a frame."""
    shape = (HEIGHT + 2 * MARGIN, WIDTH + 2 * MARGIN)
    color = np.fromfile(FOLDER / "color.raw", np.uint8).reshape(*shape, 4)
    v = [np.fromfile(FOLDER / f"{motion}_{i}.raw", np.float32).reshape(*shape, 2) for i in range(2)]
    return color, v[0], v[1]


def report(name, motion, samples, chain):
    """Runs chain(noise) -> uint8 RGB: once for its picture, then for its time."""
    picture = chain(False)
    picture.astype(np.uint8).tofile(FOLDER / f"{name}_{motion}_{samples}.out")
    chain(True)
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        chain(True)
        times.append((time.perf_counter() - start) * 1e3)
    print(json.dumps({"name": name, "motion": motion, "samples": samples, "ms": times}), flush=True)
