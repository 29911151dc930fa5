"""What all tests share. A Vulkan device is required where SHUTTERBUG_REQUIRE_DEVICE is set, as in the project's own tests."""

import contextlib
import importlib
import os

import numpy as np
import pytest

import shutterbug

# Without a window: llvmpipe draws MuJoCo where there is no GPU.
os.environ.setdefault("MUJOCO_GL", "egl")

# PyTorch's compiler and Mesa's OpenGL each bring an LLVM. Loaded after MuJoCo has drawn with Mesa, triton ends the process with a
# segmentation fault, also without any of our code; loaded before, both work.
with contextlib.suppress(ImportError):
    importlib.import_module("triton")


def pytest_configure(config):
    config.addinivalue_line("markers", "device: needs a Vulkan device")


@pytest.fixture(scope="session")
def device():
    found = [d for d in shutterbug.devices() if d["chosen"]]
    if not found:
        if os.environ.get("SHUTTERBUG_REQUIRE_DEVICE"):
            pytest.fail("no Vulkan device, and SHUTTERBUG_REQUIRE_DEVICE is set")
        pytest.skip("no Vulkan device")
    return found[0]


@pytest.fixture
def handed(monkeypatch):
    """What was handed to cameras since: (camera, picture, all else that is known of it), of each frame that was accepted."""
    frames, own = [], shutterbug.Camera.submit

    def submit(camera, rgb, **given):
        made = own(camera, rgb, **given)
        frames.append((camera, np.array(rgb, copy=True), given))
        return made

    monkeypatch.setattr(shutterbug.Camera, "submit", submit)
    return frames


@pytest.fixture
def picture():
    """A smooth texture with edges, (96, 128, 3) of uint8."""
    y, x = np.mgrid[0:96, 0:128]
    waves = [np.sin(x / 7 + c) * np.cos(y / 9 - c) + (((x // 16 + y // 16) % 2) - 0.5) for c in range(3)]
    return np.ascontiguousarray(np.clip(128 + 60 * np.stack(waves, axis=-1), 0, 255).astype(np.uint8))
