"""What is given of a frame, as the library's own struct takes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from . import _core
from ._arrays import DEPTHS, MOTIONS, Array, color_in, depth_in, ids_in, one_of, pixels, poses_of, to_numpy
from ._outputs import flags_of, outputs_of
from .errors import ArgumentError, MissingMotionError

if TYPE_CHECKING:
    from .camera import Camera

_REPEAT_BORDER, _RADIANCE = 1, 2
_LENS = ("lens_distortion", "chromatic_aberration", "focal_length_error", "pose_offset")


class Given(TypedDict, total=False):
    """What `Camera.submit` takes beside the picture. All of it is optional.

    `depth`: (height, width) of float32, m along the optical axis, infinite where nothing is; or as `depth_is` says.
    `poses`: two or more pairs (time in s, world from camera as a 4x4 matrix, or x y z and quaternion), or a pair of arrays (times,
    poses). They reach over all of the frame and `color_time`; between them lies a smooth curve.
    `ids`, `bodies`: (height, width) of int32, and ``{id: pairs of time and world from body}``, for what moves by itself.
    `motion`: (height, width, 2) of float32, px a frame period as `motion_is` says; or a list of up to six, with `motion_times`.
    `motion_times`: time of the first motion image and the step to the next, s.
    `still`: nothing moves.
    `pictures`: further instants, tuples (time in s, rgb, depth) or (time, rgb, depth, ids), at most 7.
    `time`: start of exposure of the first line, s (0). `color_time`: when the picture was rendered, s (`time`); best at
    `Camera.middle(time)`.
    `frame`: number for which noise is drawn (0). `seed`: another than the camera's from now on; opens the device anew.
    `encoding`: ``"srgb"`` or ``"linear"`` (uint8 is sRGB, floats are linear).
    `border`: ``"refuse"`` or ``"repeat"`` a margin that is too small (``"refuse"``).
    `nearest_m`: nothing that comes in at the border is nearer, m (0: not known).
    `radiance`: `Frame.radiance` will be asked for.
    `output`: what `Frame.result` gives in place of 8 bits of the kind that came in; several names: the first, the others by
    `Frame.read`. ``"uint8"`` (sRGB); ``"uint16"`` (sRGB, 65535 = white); ``"float32"`` (the same light not rounded, linear, 1 = white;
    sRGB with ``encoding="srgb"``); of cameras with ``bayer_mosaic`` the converter's numbers, (height, width) of uint16 ``"raw10"``,
    ``"raw12"``, ``"raw14"``, ``"raw16"``, or rows as MIPI CSI-2 packs them, (height, width * bits / 8) of uint8, ``"mipi10"``,
    ``"mipi12"``, ``"mipi14"``.
    `axes` of the poses' camera: ``"optical"`` (x right, y down, z forward), ``"opengl"`` (MuJoCo, Blender, USD) or ``"robot"``.
    `direction`: ``"world_from_camera"`` or ``"camera_from_world"``. `quaternion`: ``"xyzw"`` or ``"wxyz"``.
    `depth_is`: ``"metres"``, or ``("buffer" | "ndc" | "reversed" | "reversed_finite", near in m, far in m)``.
    `motion_is`: ``"own"`` (px from the previous frame to this, y down), ``"optical_flow"``, ``"fsr2"``, ``"fsr2_uv"``, ``"unity"`` or
    ``"streamline"``.
    """

    depth: Any
    poses: Any
    ids: Any
    bodies: Mapping[int, Any] | None
    motion: Any
    motion_times: tuple[float, float]
    still: bool
    pictures: Sequence[tuple[Any, ...]]
    time: float
    color_time: float | None
    frame: int
    seed: int | None
    encoding: str | None
    border: str
    nearest_m: float
    radiance: bool
    output: Any
    axes: str
    direction: str
    quaternion: str
    depth_is: str | tuple[str, float, float]
    motion_is: str


_NAMES = frozenset(Given.__annotations__)


def outside_of(camera: Camera, rgb: Array, given: Given) -> dict[str, Any]:
    """Give the fields of `shutterbug_outside`. Errors as of `Camera.submit`."""
    unknown = set(given) - _NAMES
    if unknown:
        raise TypeError(f"there is no argument {min(unknown)!r}: {', '.join(sorted(_NAMES))} are known")
    color, code = color_in(rgb, given.get("encoding"))
    margin = _margin_of(camera, color.shape)
    time_s = float(given.get("time", 0.0))
    shown = given.get("color_time")
    color_time_s = time_s if shown is None else float(shown)
    border = given.get("border", "refuse")
    if border not in ("refuse", "repeat"):
        raise ArgumentError(f"border is {border!r}: 'refuse' or 'repeat' is expected")
    asked = given
    if given.get("still") or (given.get("depth") is None and given.get("motion") is None):
        given = _at_rest(camera, color.shape, given, time_s)
    poses, bodies = _poses(given)
    moved = _motions(given, color_time_s, camera.frame_period_s)
    repeat = _REPEAT_BORDER if border == "repeat" and poses is not None else 0
    return {
        "frame_index": given.get("frame", 0),
        "time_s": time_s,
        "pictures": _shots(color_time_s, color, given),
        "poses": poses,
        "bodies": bodies,
        "nearest_m": float(given.get("nearest_m", 0.0)),
        "flags": repeat | (_RADIANCE if asked.get("radiance") else 0) | flags_of(outputs_of(asked.get("output"))),
        "encoding": code,
        "margin_px": margin,
        "depth_convention": _depth_convention(given.get("depth_is", "metres")),
        **moved,
    }


def _margin_of(camera: Camera, shape: tuple[int, ...]) -> tuple[int, int]:
    extra = (shape[1] - camera.width, shape[0] - camera.height)
    if any(e < 0 or e % 2 for e in extra):
        own = f"the camera's {camera.width}x{camera.height} px, with the same margin on opposite sides, is expected"
        raise ArgumentError(f"rgb is {shape[1]}x{shape[0]} px: {own}")
    return extra[0] // 2, extra[1] // 2


def _at_rest(camera: Camera, shape: tuple[int, ...], given: Given, time_s: float) -> Given:
    """The same where nothing moves, as motion; or where pixels look through a lens, as depth and poses."""
    if not given.get("still") and (camera.readout_time_s or camera.exposure_time_s):
        shutter = " and ".join(e for e in ("rolling_shutter", "motion_blur") if e in camera.effects)
        raise MissingMotionError(f"the camera has {shutter}: give depth and poses, or motion, or still=True where nothing moves")
    rest: Given = {}
    rest["frame"] = given.get("frame", 0)
    if any(effect in camera.effects for effect in _LENS):
        begin, end = camera.span(time_s)
        one = np.eye(4)
        rest["depth"] = np.ones(shape[:2], np.float32)
        rest["poses"] = [(min(begin, time_s) - 1.0, one), (max(end, time_s) + 1.0, one)]
    else:
        rest["motion"] = np.zeros((*shape[:2], 2), np.float32)
    return rest


def _poses(given: Given) -> tuple[_core.Poses | None, list[tuple[int, _core.Poses]]]:
    quaternion = given.get("quaternion", "xyzw")
    axes, direction = given.get("axes", "optical"), given.get("direction", "world_from_camera")
    poses = given.get("poses")
    stamped = None if poses is None else poses_of(poses, "poses", axes, direction, quaternion)
    bodies = given.get("bodies") or {}
    return stamped, [(i, poses_of(p, f"poses of body {i}", quaternion=quaternion)) for i, p in bodies.items()]


def _shots(color_time_s: float, color: Array, given: Given) -> list[tuple[float, Array, Array | None, Array | None]]:
    bodies = given.get("bodies")
    shots = [(color_time_s, color, depth_in(given.get("depth")), ids_in(given.get("ids"), bodies))]
    for further in given.get("pictures", ()):
        if not 3 <= len(further) <= 4:
            raise ArgumentError("pictures are tuples (time in s, rgb, depth) or (time, rgb, depth, ids)")
        when, more, depth, *rest = further
        seen, _ = color_in(to_numpy(more, "a further picture"), given.get("encoding"))
        shots.append((float(when), seen, depth_in(depth), ids_in(rest[0] if rest else None, bodies)))
    return shots


def _motions(given: Given, color_time_s: float, frame_period_s: float) -> dict[str, Any]:
    motion = given.get("motion")
    motions = [] if motion is None else motion if isinstance(motion, list | tuple) else [motion]
    times = given.get("motion_times")
    if len(motions) > 1 and times is None:
        raise ArgumentError("several motion images need motion_times: time of the first and step, s")
    first, step = times or (color_time_s, frame_period_s)
    return {
        "motions": [pixels(to_numpy(m, "motion"), [np.float32], np.float32) for m in motions],
        "first_motion_time_s": float(first),
        "motion_step_s": float(step),
        "motion_convention": _core.motion_preset(one_of(MOTIONS, given.get("motion_is", "own"), "motion_is")),
    }


def _depth_convention(given: str | tuple[str, float, float]) -> tuple[int, float, float]:
    kind, near_m, far_m = (given, 0.0, 0.0) if isinstance(given, str) else given
    return one_of(DEPTHS, kind, "depth_is"), float(near_m), float(far_m)
