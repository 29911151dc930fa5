"""Whether two frames agree with what is said of their depth and poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _core
from ._arrays import Array, color_in, pixels, poses_of, to_numpy
from .camera import Camera
from .errors import ArgumentError

_VERDICTS = ("agree", "agree_better", "unknown", "never")
_CHANGES = (
    "axes_opengl",
    "camera_from_world",
    "quaternion_wxyz",
    "depth_millimetres",
    "depth_along_ray",
    "bottom_up",
    "other_encoding",
)


@dataclass(frozen=True)
class Agreement:
    """What `check_conventions` found.

    `verdict`: ``"agree"``, ``"agree_better"`` (with `changes`), ``"unknown"`` (the camera hardly moves between the two) or ``"never"``.
    `changes`: what to change, of ``"axes_opengl"``, ``"camera_from_world"``, ``"quaternion_wxyz"``, ``"depth_millimetres"``,
    ``"depth_along_ray"``, ``"bottom_up"`` and ``"other_encoding"`` (8-bit rgb is taken for sRGB, floats for linear). `as_given`,
    `best`: mean difference (square root of radiance, 0 to 0.25). `sentence`: the same for a person.
    """

    verdict: str
    changes: tuple[str, ...]
    as_given: float
    best: float
    sentence: str

    def __bool__(self) -> bool:
        """Whether the frames agree as they are given."""
        return self.verdict == "agree"


def check_conventions(
    camera: Camera,
    first: tuple[Any, Any, Any],
    second: tuple[Any, Any, Any],
    axes: str = "optical",
    direction: str = "world_from_camera",
    quaternion: str = "xyzw",
) -> Agreement:
    """Say whether two frames of a scene at rest agree with their depth and poses, or would in another convention.

    `camera`: its size and pinhole. `first`, `second`: rgb (height, width, 3 or 4) of uint8 or floats, depth (height, width) of float32, m
    along the optical axis, pose (4x4, or x y z and quaternion), of the camera's size, without margin. `axes`, `direction`, `quaternion`
    as of `Given`. The camera should move and turn by a few degrees about more than one axis between them. Takes milliseconds and no
    device. ArgumentError, FormatError: shapes and types. Wrong conventions give plausible pictures: check once.
    """
    colors: list[Array] = []
    depths: list[Array] = []
    for rgb, depth, _ in (first, second):
        colors.append(color_in(to_numpy(rgb, "rgb"), None)[0])
        depths.append(pixels(to_numpy(depth, "depth"), [np.float32], np.float32))
        if colors[-1].shape[:2] != (camera.height, camera.width) or depths[-1].shape != colors[-1].shape[:2]:
            raise ArgumentError(f"rgb and depth of {camera.width}x{camera.height} px are expected")
    poses = poses_of([(0.0, first[2]), (1.0, second[2])], "the poses", axes, direction, quaternion)
    k = camera.matrix
    pinhole = (camera.width, camera.height, k[0, 0], k[1, 1], k[0, 2], k[1, 2])
    verdict, bits, given, best, sentence = _core.check_conventions(pinhole, colors, depths, poses)
    changes = tuple(name for i, name in enumerate(_CHANGES) if bits >> i & 1)
    return Agreement(_VERDICTS[verdict], changes, given, best, sentence)
