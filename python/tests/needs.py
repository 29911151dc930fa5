"""What some tests need and not every machine has: they are skipped by name where it is missing."""

import functools
import os
import subprocess
import sys

import pytest

os.environ.setdefault("MUJOCO_GL", "egl")
_DRAW = "import mujoco; mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>'), 8, 8).close()"


@functools.cache
def _cannot_draw():
    run = subprocess.run([sys.executable, "-c", _DRAW], capture_output=True, text=True)
    said = run.stderr.strip().splitlines()
    return said[-1] if run.returncode and said else ""


def mujoco():
    """Skips a module where MuJoCo is not installed, or has no OpenGL to draw with."""
    if _cannot_draw():
        pytest.skip(f"MuJoCo cannot draw with MUJOCO_GL={os.environ['MUJOCO_GL']}: {_cannot_draw()}", allow_module_level=True)


def long(why):
    """Skips what takes minutes, by name, unless SHUTTERBUG_LONG asks for it."""
    if not os.environ.get("SHUTTERBUG_LONG"):
        pytest.skip(f"long, SHUTTERBUG_LONG=1 runs it: {why}")
