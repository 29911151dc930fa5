"""Shutterbug: what a real, cheap, moving camera does to a picture, and which of it explains a sim-to-real gap.

`Camera` turns frames of any renderer into what a real camera would have delivered. `simulate`, `diagnose`, `calibrate` and `board` work
on folders. `shutterbug.mujoco`, `.newton`, `.blender`, `.gymnasium`, `.transforms`, `.ray` and `.bag` bring it to where frames are made;
each is imported by its name, and needs what its name says.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from . import errors
from ._core import VERSION as __version__
from ._device import devices
from ._given import Given
from .camera import Camera
from .errors import ShutterbugError
from .frame import Frame

if TYPE_CHECKING:
    from ._board import Board, board
    from .check import Agreement, check_conventions
    from .folders import Diagnosis, calibrate, diagnose, presets, simulate

__all__ = [
    "Agreement",
    "Board",
    "Camera",
    "Diagnosis",
    "Frame",
    "Given",
    "ShutterbugError",
    "__version__",
    "board",
    "calibrate",
    "check_conventions",
    "devices",
    "diagnose",
    "errors",
    "presets",
    "simulate",
]

# Imported when they are first asked for: a worker that only makes frames starts sooner.
_LATER = {
    **dict.fromkeys(("Agreement", "check_conventions"), "check"),
    **dict.fromkeys(("Board", "board"), "_board"),
    **dict.fromkeys(("Diagnosis", "calibrate", "diagnose", "presets", "simulate"), "folders"),
}


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import importlib

    return getattr(importlib.import_module(f".{_LATER[name]}", __name__), name)
