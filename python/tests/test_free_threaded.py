"""Threads without a global lock: where the interpreter has none it stays off, and cameras and frames stand threads that use them at once.

The bits are compared on every interpreter; `tools/python-tests` runs all tests a second time on each free-threaded one that it finds.
"""

import subprocess
import sys
import sysconfig
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from shutterbug import Camera, errors

NOISE = {"read_noise": {"sigma": 0.02}}
LOCK = "import sys, shutterbug; print(sys._is_gil_enabled())"


def free_threaded():
    if not sysconfig.get_config_var("Py_GIL_DISABLED"):
        pytest.skip("this interpreter has a global lock: a free-threaded one is needed (python3.14t)")


def lock_is_off():
    """True as well on an interpreter that always has one: it has no such question."""
    return not sysconfig.get_config_var("Py_GIL_DISABLED") or not sys._is_gil_enabled()


def test_import_leaves_the_lock_off():
    free_threaded()
    run = subprocess.run([sys.executable, "-W", "error", "-c", LOCK], capture_output=True, text=True)
    assert run.stdout.strip() == "False", run.stderr
    control = subprocess.run([sys.executable, "-X", "gil=1", "-c", LOCK], capture_output=True, text=True)
    assert control.stdout.strip() == "True", "control: with the lock on, the same line says so"


def at_once(calls):
    """Results of calls that threads begin together, in their order."""
    gate = threading.Barrier(len(calls))

    def run(call):
        gate.wait(60)
        return call()

    with ThreadPoolExecutor(len(calls)) as pool:
        return list(pool.map(run, calls))


def test_two_threads_with_a_camera_each(device, picture):
    """Each sees what it would see alone, though the two are of other sizes, effects and seeds."""
    flow = np.full((96, 128, 2), 12, np.float32)
    noisy = Camera(128, 96, fovy=50, effects=NOISE, seed=1)
    blurred = Camera(64, 48, fovy=50, exposure_time_s=0.01, seed=2, effects=NOISE)
    small = np.ascontiguousarray(picture[::2, ::2])
    alone = [[noisy(picture, frame=i) for i in range(40)], [blurred(small, motion=flow[::2, ::2], frame=i) for i in range(40)]]

    found = at_once(
        [
            lambda: [noisy(picture, frame=i) for i in range(40)],
            lambda: [blurred(small, motion=flow[::2, ::2], frame=i) for i in range(40)],
        ]
    )
    assert all(np.array_equal(f, a) for ours, theirs in zip(found, alone, strict=True) for f, a in zip(ours, theirs, strict=True))
    assert not np.array_equal(found[0][0], found[0][1]), "control: frames differ, so one in another's place would show"
    assert lock_is_off()


def test_threads_that_share_a_camera(device, picture):
    cam = Camera(128, 96, fovy=50, effects=NOISE, frames_in_flight=3)
    alone = [cam(picture, frame=i) for i in range(6)]
    cam.close()
    # The first calls race to open the device, too.
    found = at_once([lambda k=k: [cam(picture, frame=(k + i) % 6) for i in range(20)] for k in range(6)])
    assert all(np.array_equal(f, alone[(k + i) % 6]) for k, row in enumerate(found) for i, f in enumerate(row))
    assert lock_is_off()


def test_threads_that_change_a_camera_while_others_use_it(device, picture):
    """Each picture is that of one of the two cameras, never of half of each; a change in the middle of a frame is refused."""
    plain, bright = Camera(128, 96, fovy=50), Camera(128, 96, fovy=50, effects={"vignetting": {"a1": -0.5, "a2": 0.0}})
    whole = [plain(picture), bright(picture)]
    cam, refused = Camera(128, 96, fovy=50), []

    def change():
        for i in range(40):
            try:
                cam.become((plain, bright)[i % 2])
            except errors.StateError as error:
                refused.append(error)

    found = at_once([change, *[lambda: [cam(picture) for _ in range(25)]] * 2])
    assert all(any(np.array_equal(p, w) for w in whole) for row in found[1:] for p in row)
    assert not np.array_equal(*whole) and len(refused) < 40
    assert lock_is_off()


def test_threads_that_share_a_frame(device, picture):
    """Read by some while one closes it: each has the whole picture, or hears that the frame is closed."""
    cam = Camera(128, 96, fovy=50, effects=NOISE)
    expected = cam(picture, frame=3)
    seen = []

    def read(frame):
        try:
            return frame.result()
        except (errors.HandleError, errors.StateError) as error:
            return error

    for _ in range(30):
        frame = cam.submit(picture, frame=3)
        seen += at_once([lambda f=frame: read(f)] * 3 + [frame.close])[:3]
    pictures = [s for s in seen if isinstance(s, np.ndarray)]
    assert all(np.array_equal(p, expected) for p in pictures)
    assert all(str(s) for s in seen if not isinstance(s, np.ndarray))
    # Nothing is broken by it.
    assert np.array_equal(cam(picture, frame=3), expected) and lock_is_off()
