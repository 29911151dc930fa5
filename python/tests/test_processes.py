"""Threads, forks, pickles, interruptions, memory: what a package in a long-lived host has to stand."""

import gc
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from shutterbug import Camera, errors

NOISE = {"read_noise": {"sigma": 0.02}}


def test_threads_take_turns_and_get_their_own_frames(device, picture):
    cam = Camera(128, 96, fovy=50, effects=NOISE)
    expected = [cam(picture, frame=i) for i in range(8)]
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda i: cam(picture, frame=i % 8), range(64)))
    assert all(np.array_equal(f, expected[i % 8]) for i, f in enumerate(found))


def test_the_interpreter_is_let_go_while_a_frame_is_waited_for(device):
    cam = Camera(1280, 960, fovy=50, exposure_time_s=0.03)
    rgb, flow = np.full((960, 1280, 3), 99, np.uint8), np.full((960, 1280, 2), 20, np.float32)
    cam(rgb, motion=flow)
    counted, done = 0, threading.Event()

    def count():
        nonlocal counted
        while not done.is_set():
            counted += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    begun = time.perf_counter()
    cam(rgb, motion=flow)
    spent_s = time.perf_counter() - begun
    done.set()
    thread.join()
    # Held, the other thread would not have run at all.
    assert counted > 0.2 * spent_s / 0.0015


def test_several_frames_are_in_flight_and_come_in_any_order(device, picture):
    cam = Camera(128, 96, fovy=50, effects=NOISE, frames_in_flight=3)
    frames = [cam.submit(picture, frame=i) for i in range(3)]
    with pytest.raises(errors.FullError):
        cam.submit(picture)
    last = frames[2].result()
    first = frames[0].result()
    assert np.array_equal(first, cam(picture, frame=0)) and np.array_equal(last, cam(picture, frame=2))
    frames[1].close()
    with pytest.raises(errors.HandleError):
        frames[1].result()


def test_a_closed_camera_opens_anew_and_its_frames_say_so(device, picture):
    cam = Camera(128, 96, fovy=50)
    waiting = cam.submit(picture)
    cam.close()
    with pytest.raises(errors.ShutterbugError):
        waiting.result()
    assert np.array_equal(cam(picture), picture)


def _in_child(cam, picture, pipe):
    pipe.send(cam(picture, frame=5))


def test_a_forked_child_makes_its_own(device, picture):
    cam = Camera(128, 96, fovy=50, effects=NOISE)
    expected = cam(picture, frame=5)
    stop, context = threading.Event(), multiprocessing.get_context("fork")
    # The parent is in the middle of calls, with its lock held, when it forks.
    busy = threading.Thread(target=lambda: [cam(picture) for _ in iter(stop.is_set, True)])
    busy.start()
    try:
        for _ in range(3):
            ours, theirs = context.Pipe()
            child = context.Process(target=_in_child, args=(cam, picture, theirs))
            child.start()
            assert ours.poll(60), "the child hangs"
            assert np.array_equal(ours.recv(), expected)
            child.join(20)
            assert child.exitcode == 0
    finally:
        stop.set()
        busy.join()
    assert np.array_equal(cam(picture, frame=5), expected)


def test_a_parents_frame_says_that_it_is_of_the_parent(device, picture):
    cam = Camera(128, 96, fovy=50)
    frame = cam.submit(picture)
    child = os.fork()
    if child == 0:
        try:
            frame.result()
        except errors.ForkedError:
            os._exit(42)
        except BaseException:
            os._exit(43)
        os._exit(44)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 42
    assert np.array_equal(frame.result(), picture)


def test_cameras_are_pickled_by_what_they_say(device, picture):
    cam = Camera(128, 96, fovy=50, effects=NOISE, seed=9)
    copy = pickle.loads(pickle.dumps(cam))
    assert copy.toml == cam.toml and np.array_equal(copy(picture, frame=2), cam(picture, frame=2))


def interruptible():
    """In a child, before it becomes another program: where tests run in the background, SIGINT is ignored, and that is inherited."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


INTERRUPTED = """
import _thread, threading, numpy as np, shutterbug
cam = shutterbug.Camera(1024, 1024, fovy=50, exposure_time_s=0.03)
rgb, flow = np.full((1024, 1024, 3), 99, np.uint8), np.full((1024, 1024, 2), 200, np.float32)
threading.Timer(1.0, _thread.interrupt_main).start()
try:
    for _ in range(1000):
        cam(rgb, motion=flow)
    print("not interrupted")
except KeyboardInterrupt:
    print("interrupted", int(cam(rgb[:], still=True).mean()))
"""


def test_an_interruption_leaves_the_camera_as_it_was(device):
    out = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, timeout=120, preexec_fn=interruptible)
    assert out.stdout.strip() == "interrupted 99", out


def test_an_interrupted_run_of_the_program_ends_it(tmp_path, device):
    script = "import shutterbug; shutterbug.simulate({!r}, {!r}, method='accumulation', progress=print)"
    capture = os.environ.get("SHUTTERBUG_DEMO_CAPTURE", "")
    if not capture:
        pytest.skip("SHUTTERBUG_DEMO_CAPTURE names no capture")
    run = subprocess.Popen(
        [sys.executable, "-c", script.format(capture, str(tmp_path / "out"))],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=interruptible,
    )
    children = Path(f"/proc/{run.pid}/task/{run.pid}/children")
    while not (found := children.read_text().split()):
        assert run.poll() is None, "it ended without starting the program"
        time.sleep(0.01)
    child = int(found[0])
    while Path(f"/proc/{child}/cmdline").read_bytes() == Path(f"/proc/{run.pid}/cmdline").read_bytes():
        time.sleep(0.001)
    # The program stands still until the parent, which waits for its lines by then, has been told: no machine is too fast for that.
    os.kill(child, signal.SIGSTOP)
    time.sleep(0.5)
    run.send_signal(signal.SIGINT)
    time.sleep(0.2)
    os.kill(child, signal.SIGCONT)
    _, said = run.communicate(timeout=60)
    assert run.returncode != 0 and "KeyboardInterrupt" in said
    assert not os.path.exists(f"/proc/{child}")


def resident_bytes():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_memory_is_flat_over_many_frames(device):
    """A part of them here; SHUTTERBUG_FRAMES asks for more."""
    count = int(os.environ.get("SHUTTERBUG_FRAMES", "1500"))
    cam = Camera(64, 48, fovy=50, effects=NOISE, exposure_time_s=0.01)
    rgb, flow = np.full((48, 64, 3), 99, np.uint8), np.full((48, 64, 2), 3, np.float32)
    poses = [(-0.1, np.eye(4)), (0.1, np.eye(4))]
    depth = np.ones((48, 64), np.float32)

    def some(frames):
        for i in range(frames):
            cam(rgb, motion=flow, frame=i)
            cam(rgb.astype(np.float32), depth=depth, poses=poses, frame=i)

    some(300)
    gc.collect()
    before = resident_bytes()
    some(count // 2)
    gc.collect()
    grown = resident_bytes() - before
    print(f"{count} frames: {grown / 1e6:.2f} MB more")
    assert grown < 6_000_000
