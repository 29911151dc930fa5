"""ROS `camera_info` as the text of its file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


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
