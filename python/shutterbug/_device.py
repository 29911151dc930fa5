"""Which device a camera runs on: a GPU, else a software driver of the machine, else the driver of the package shutterbug-driver."""

from __future__ import annotations

import importlib
import logging
import os
from typing import Any

from . import _core
from .errors import NoDeviceError

_log = logging.getLogger("shutterbug")
_said: set[str] = set()


def bundled_driver() -> str | None:
    """Path of the driver that ``pip install shutterbug-driver`` brings, or None."""
    try:
        module = importlib.import_module("shutterbug_driver")
    except ImportError:
        return None
    path = str(module.library_path())
    return path if os.path.exists(path) else None


def open_engine(
    device: str | None,
    seed: int,
    limits: tuple[int, int, int],
    time_limit_s: float,
) -> _core.Engine:
    """Open an engine on the device that is asked for, or on the best that there is, and say once which one that is."""
    device = device or os.environ.get("SHUTTERBUG_DEVICE") or None
    bundled = bundled_driver()
    named = os.environ.get("SHUTTERBUG_VULKAN_LIBRARY")
    if device is not None and bundled is not None and device.lower() in ("bundled", "shutterbug-driver"):
        engine = _core.Engine(None, bundled, seed, limits, time_limit_s)
    else:
        try:
            engine = _core.Engine(device, named or None, seed, limits, time_limit_s)
        except NoDeviceError as error:
            if bundled is None:
                hint = "; or: pip install shutterbug-driver, a software driver that needs nothing else"
                raise NoDeviceError(f"{error}{hint}") from None
            engine = _core.Engine(device, bundled, seed, limits, time_limit_s)
    _say(engine.info())
    return engine


def _say(about: dict[str, Any]) -> None:
    line = f"runs on {about['name']} ({about['driver']})"
    if line in _said:
        return
    _said.add(line)
    slower = ", a software driver: far slower than a GPU" if about["kind"] == "software" else ""
    if slower and "SwiftShader" in line:
        slower += ", and about 7 times slower than lavapipe (apt-get install mesa-vulkan-drivers)"
    _log.log(logging.WARNING if "SwiftShader" in line else logging.INFO, "shutterbug %s%s", line, slower)


def devices() -> list[dict[str, Any]]:
    """List the Vulkan devices, the best first.

    Each is a dictionary: ``index``, ``name``, ``driver``, ``uuid``, ``kind`` (``"discrete GPU"``, ``"integrated GPU"``,
    ``"virtual GPU"``, ``"other"`` or ``"software"``), ``missing`` (what is needed and not there; empty: it can be used), ``chosen``
    (whether a camera without ``device=`` takes it) and ``why``. The driver of the package shutterbug-driver comes last.
    An empty list: the machine has neither a Vulkan loader with a driver nor that package. That
    raises nothing; DeviceLostError, VulkanError and the like: a driver fails.
    """
    try:
        found = _core.devices()
    except NoDeviceError:
        found = []
    bundled = bundled_driver()
    if bundled is not None:
        engine = _core.Engine(None, bundled)
        about = engine.info()
        engine.close()
        entry = {name: about[name] for name in ("name", "driver", "uuid", "kind")}
        found.append({"index": len(found), **entry, "missing": [], "file": bundled})
    chosen = next((i for i, d in enumerate(found) if not d["missing"]), None)
    for i, entry in enumerate(found):
        entry["chosen"] = i == chosen
        entry["why"] = _why(entry)
    return found


def _why(entry: dict[str, Any]) -> str:
    if entry["missing"]:
        return "lacks " + ", ".join(entry["missing"])
    if "file" in entry:
        return "the driver of the package shutterbug-driver: taken where nothing else is there"
    if entry["kind"] == "software":
        return "a software driver: taken where there is no GPU"
    return "a GPU: taken before any software driver"
