"""What a frame can be read as: more than 8 bits, linear floats, the converter's own numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .errors import ArgumentError

if TYPE_CHECKING:
    from ._arrays import Array
    from .frame import Frame

# Planes, flags and formats of include/shutterbug.h.
PICTURE, RADIANCE, RAW = 1, 5, 6
RGBA32F = 5
_RGB8, _RGBA8, _RGB16, _RGBA16 = 1, 2, 13, 14
_BAYER10, _MIPI_RAW10 = 15, 19
_FINE_FLAG, _RAW_FLAG = 4, 8
# Pixels that are packed together.
_GROUPS = {"mipi10": 4, "mipi12": 2, "mipi14": 4}
_WORDS = ("raw10", "raw12", "raw14", "raw16")
NAMES = ("uint8", "uint16", "float32", *_WORDS, *_GROUPS)


@dataclass(frozen=True)
class Layout:
    """A plane and a format of the C ABI, and the array that they fill."""

    plane: int
    format: int
    shape: tuple[int, ...]
    dtype: npt.DTypeLike


def outputs_of(given: Any) -> tuple[str, ...]:
    """Give the names that `output` of a frame asks for: a name or dtype, or several. ArgumentError lists the names there are."""
    if given is None:
        return ()
    several = isinstance(given, Sequence) and not isinstance(given, str)
    asked = tuple(given) if several else (given,)
    return tuple(_name(one) for one in asked)


def _name(one: Any) -> str:
    try:
        name = one if isinstance(one, str) else np.dtype(one).name
    except TypeError:
        name = repr(one)
    if name not in NAMES:
        raise ArgumentError(f"output is {name!r}: one of {', '.join(map(repr, NAMES))}, or several, is expected")
    return name


def flags_of(outputs: Sequence[str]) -> int:
    """Give the flags of `shutterbug_outside` that these outputs need."""
    fine = any(name in ("uint16", "float32") for name in outputs)
    raw = any(name in _WORDS or name in _GROUPS for name in outputs)
    return _FINE_FLAG * fine | _RAW_FLAG * raw


def checked(output: Any, width: int, height: int) -> tuple[str, ...]:
    """Give the names of `outputs_of`, for what delivers frames of one size. ArgumentError too where the width cannot be packed."""
    names = outputs_of(output)
    for name in names:
        layout_of(name, (height, width, 3))
    return names


def highest_of(output: str) -> float:
    """Give the largest number that an output can hold, in its own units: 255, 65535, 1 (white), or all bits of the converter."""
    name = _name(output)
    if name in _WORDS:
        return float(2 ** int(name[-2:]) - 1)
    return {"uint16": 65535.0, "float32": 1.0}.get(name, 255.0)


def read_of(frame: Frame, names: tuple[str, ...], out: Array | None = None) -> Array:
    """Give the first output of a frame in numpy, 8 bits of sRGB where none is named; written into `out`, converted, where that is given."""
    size = frame._size
    name = names[0] if names else "uint8"
    layout = layout_of(name, size)
    fits = out is not None and out.dtype == layout.dtype and out.shape == layout.shape and out.flags.c_contiguous
    plane: Array = frame.read(name, out if fits else None)
    if out is None or plane is out:
        return plane
    np.copyto(out, plane, casting="unsafe")
    return out


def layout_of(output: str, size: tuple[int, int, int]) -> Layout:
    """Give how an output of (height, width, 3 or 4) is read. ArgumentError: no such output, or a width that cannot be packed."""
    name, (height, width, channels) = _name(output), size
    wide = channels == 4
    if name == "uint8":
        return Layout(PICTURE, _RGBA8 if wide else _RGB8, size, np.uint8)
    if name == "uint16":
        return Layout(PICTURE, _RGBA16 if wide else _RGB16, size, np.uint16)
    if name == "float32":
        return Layout(PICTURE, RGBA32F, (height, width, 4), np.float32)
    bits = int(name[-2:])
    step = (bits - 10) // 2
    if name in _WORDS:
        return Layout(RAW, _BAYER10 + step, (height, width), np.uint16)
    if width % _GROUPS[name]:
        raise ArgumentError(f"{name} packs {_GROUPS[name]} pixels together: {width} columns are no multiple of that")
    return Layout(RAW, _MIPI_RAW10 + step, (height, width * bits // 8), np.uint8)
