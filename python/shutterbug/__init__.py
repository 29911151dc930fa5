"""Shutterbug: what a real, cheap, moving camera does to a picture, and which of it explains a sim-to-real gap.

`Camera` turns frames of any renderer into what a real camera would have delivered. `simulate`, `diagnose` and `calibrate` work on
folders. `shutterbug.mujoco`, `.newton`, `.blender`, `.gymnasium`, `.transforms`, `.ray` and `.bag` bring it to where frames are made;
each is imported by its name, and needs what its name says.
"""

from __future__ import annotations

from . import errors
from ._core import VERSION as __version__
from ._device import devices
from .camera import Camera
from .check import Agreement, check_conventions
from .errors import ShutterbugError
from .folders import Diagnosis, calibrate, diagnose, presets, simulate
from .frame import Frame

__all__ = [
    "Agreement",
    "Camera",
    "Diagnosis",
    "Frame",
    "ShutterbugError",
    "__version__",
    "calibrate",
    "check_conventions",
    "devices",
    "diagnose",
    "errors",
    "presets",
    "simulate",
]
