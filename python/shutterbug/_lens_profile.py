"""Cameras of others: lens profiles of Gyroflow as ROS `camera_info`, and that as text."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from .errors import InputError


def _number(table: dict[str, Any], name: str, path: str) -> float:
    value = table.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{path}: {name} is {value!r}: a number is expected, as in a lens profile of Gyroflow")
    return float(value)


def _size(profile: dict[str, Any], path: str) -> tuple[int, int]:
    size = profile.get("calib_dimension") or profile.get("orig_dimension")
    if not isinstance(size, dict):
        raise InputError(f"{path}: calib_dimension is {size!r}: w and h in px are expected, as in a lens profile of Gyroflow")
    return int(_number(size, "w", path)), int(_number(size, "h", path))


def camera_of_profile(text: str, path: str) -> tuple[str, dict[str, Any], float, list[str]]:
    """Give a profile's camera_info, tables of its effects, frames a second (Hz), and what was left out. InputError says what is amiss."""
    try:
        profile = json.loads(text)
    except ValueError as error:
        raise InputError(f"{path}: {error}: the JSON of a lens profile of Gyroflow is expected") from None
    if not isinstance(profile, dict) or not isinstance(profile.get("fisheye_params"), dict):
        raise InputError(f"{path}: there is no fisheye_params: a lens profile of Gyroflow is expected")
    lens, notes = profile["fisheye_params"], []
    matrix, coefficients = lens.get("camera_matrix"), lens.get("distortion_coeffs", [])
    width, height = _size(profile, path)
    model = profile.get("distortion_model") or "opencv_fisheye"
    if model != "opencv_fisheye":
        raise InputError(f"{path}: distortion_model is {model!r}: opencv_fisheye is expected")
    info = {
        "image_width": width,
        "image_height": height,
        "camera_name": str(profile.get("name") or "camera"),
        "camera_matrix": {"rows": 3, "cols": 3, "data": [v for row in matrix or [] for v in row]},
        "distortion_model": "equidistant",
        "distortion_coefficients": {"rows": 1, "cols": len(coefficients), "data": coefficients},
    }
    rate_hz = _number(profile, "fps", path) if profile.get("fps") else 30.0
    if not profile.get("fps"):
        notes.append("the profile has no fps: 30 frames a second are assumed")
    tables: dict[str, Any] = {}
    readout_ms = profile.get("frame_readout_time")
    if readout_ms:
        upward = _number(profile, "frame_readout_time", path) < 0
        order = "bottom_to_top" if upward else "top_to_bottom"
        tables["rolling_shutter"] = {"readout_time_s": abs(float(readout_ms)) * 1e-3, "scan_order": order}
    else:
        notes.append("the profile has no frame_readout_time: a global shutter is assumed")
    return json.dumps(info, indent=1), tables, rate_hz, notes


def text_of_camera_info(info: Any) -> str:
    """A message or dictionary of CameraInfo as the YAML that its file would be: JSON is YAML."""
    names = ("width", "height", "distortion_model", "d", "k", "r", "p", "D", "K", "R", "P", "image_width", "image_height",
             "camera_matrix", "distortion_coefficients", "camera_name", "binning_x", "binning_y")  # fmt: skip
    plain = {}
    for name in names:
        value = info.get(name) if isinstance(info, Mapping) else getattr(info, name, None)
        if value is not None:
            plain[name] = value.tolist() if hasattr(value, "tolist") else list(value) if isinstance(value, tuple) else value
    return json.dumps(plain, indent=1, default=list)
