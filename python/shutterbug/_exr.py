"""Reads the OpenEXR files that Blender is asked for: scan lines, one part, not compressed."""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import Any

import numpy as np

from ._arrays import Array
from .errors import InputError

_DTYPES: dict[int, np.dtype[Any]] = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}


def _text(data: bytes, at: int) -> tuple[str, int]:
    end = data.index(b"\0", at)
    return data[at:end].decode("latin-1"), end + 1


def _header(data: bytes) -> tuple[dict[str, bytes], int]:
    magic, version = struct.unpack_from("<II", data, 0)
    if magic != 20000630 or version & 0x1A00:
        raise InputError("a file is no OpenEXR of scan lines in one part")
    found: dict[str, bytes] = {}
    at = 8
    while data[at]:
        name, at = _text(data, at)
        _, at = _text(data, at)
        (size,) = struct.unpack_from("<I", data, at)
        found[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    return found, at + 1


def read_exr(file: str | os.PathLike[str]) -> dict[str, Array]:
    """Give the channels of a file, (height, width) of float32 each, by names. InputError: it is compressed, in tiles, or cut short."""
    data = Path(file).read_bytes()
    try:
        header, at = _header(data)
        if header["compression"][0] != 0:
            raise InputError(f"{os.fspath(file)}: it is compressed: the codec NONE is expected")
        left, top, right, bottom = struct.unpack("<4i", header["dataWindow"])
        channels, place = [], 0
        listed = header["channels"]
        while listed[place]:
            name, place = _text(listed, place)
            (kind,) = struct.unpack_from("<I", listed, place)
            channels.append((name, _DTYPES[kind]))
            place += 16
        width, height = right - left + 1, bottom - top + 1
        planes = {name: np.empty((height, width), np.float32) for name, _ in channels}
        for offset in struct.unpack_from(f"<{height}Q", data, at):
            (y,) = struct.unpack_from("<i", data, offset)
            from_here = offset + 8
            for name, dtype in channels:
                planes[name][y - top] = np.frombuffer(data, dtype, width, from_here)
                from_here += width * dtype.itemsize
    except (struct.error, KeyError, IndexError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{os.fspath(file)}: {error}: an OpenEXR file of scan lines is expected") from None
    return planes
