"""Arrays in and out: numpy and anything with DLPack, colour encodings, poses."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from .errors import ArgumentError

Array = npt.NDArray[Any]

FORMS = {"xyzw": 0, "wxyz": 1, "matrix": 2}
AXES = {"optical": 0, "opengl": 1, "robot": 2}
DIRECTIONS = {"world_from_camera": 0, "camera_from_world": 1}
MOTIONS = {"own": 0, "fsr2": 1, "fsr2_uv": 2, "unity": 3, "streamline": 4, "optical_flow": 5}
DEPTHS = {"metres": 0, "reversed": 1, "buffer": 2, "reversed_finite": 3, "ndc": 4}


def one_of(names: dict[str, int], given: str, what: str) -> int:
    """Give the number of a name. ArgumentError lists the names there are."""
    if given not in names:
        raise ArgumentError(f"{what} is {given!r}: one of {', '.join(map(repr, names))} is expected")
    return names[given]


def to_numpy(array: Any, what: str) -> Array:
    """See an array as numpy's without a copy where its memory is the host's. ArgumentError says what cannot be seen so."""
    if isinstance(array, np.ndarray):
        return array
    if hasattr(array, "__dlpack__"):
        try:
            return np.from_dlpack(array)
        except (BufferError, RuntimeError, TypeError, ValueError) as error:
            raise ArgumentError(f"{what}: {error}; arrays in the memory of a GPU have to be moved first") from None
    seen = np.asarray(array)
    if seen.dtype == object:
        raise ArgumentError(f"{what} is {type(array).__name__}: an array is expected")
    return seen


def like(original: Any) -> Callable[[Array], Any]:
    """Give the function that makes numpy's array one of the kind of `original`: numpy, PyTorch, JAX, CuPy, or any of the array API."""
    if isinstance(original, np.ndarray) or not hasattr(original, "__dlpack__"):
        return lambda array: array
    top = type(original).__module__.split(".")[0]
    if hasattr(original, "__array_namespace__"):
        return original.__array_namespace__().from_dlpack  # type: ignore[no-any-return]
    name = {"jaxlib": "jax.numpy", "jax": "jax.numpy"}.get(top, top)
    return importlib.import_module(name).from_dlpack  # type: ignore[no-any-return]


def pixels(array: Array, item_dtypes: Iterable[type], otherwise: type) -> Array:
    """Give an array of one of the types, with pixels side by side in each row; copied only where it is not so already."""
    if array.dtype not in [np.dtype(t) for t in item_dtypes]:
        array = array.astype(otherwise)
    inner = array.itemsize * (array.shape[2] if array.ndim == 3 else 1)
    beside = array.ndim < 3 or array.strides[2] == array.itemsize or array.shape[2] == 1
    apart = array.ndim < 2 or abs(array.strides[0]) >= inner * array.shape[1]
    if array.ndim >= 2 and beside and apart and array.strides[1] == inner:
        return array
    return np.ascontiguousarray(array)


def _linear_of_srgb(value: Array) -> Array:
    return np.where(value <= 0.04045, value / 12.92, ((np.maximum(value, 0.04045) + 0.055) / 1.055) ** 2.4)


def srgb_of_linear(value: Array) -> Array:
    """Give linear values, 1 = white, in sRGB."""
    return np.where(value <= 0.0031308, value * 12.92, 1.055 * np.maximum(value, 0.0031308) ** (1 / 2.4) - 0.055)


_LINEAR_OF_BYTE: Array = _linear_of_srgb(np.arange(256) / 255).astype(np.float32)


def color_in(array: Array, encoding: str | None) -> tuple[Array, int]:
    """Give colour as the library reads it and the number of its encoding. uint8 is sRGB unless said otherwise, floats are linear."""
    if encoding not in (None, "srgb", "linear"):
        raise ArgumentError(f"encoding is {encoding!r}: 'srgb' or 'linear' is expected")
    if array.ndim != 3 or array.shape[2] not in (3, 4):
        raise ArgumentError(f"colour has the shape {array.shape}: (height, width, 3 or 4) is expected")
    if array.dtype == np.uint8:
        return pixels(array, [np.uint8], np.uint8), int(encoding == "linear")
    if array.dtype.kind != "f":
        raise ArgumentError(f"colour is of {array.dtype}: uint8 or floats are expected")
    if encoding == "srgb":
        array = _linear_of_srgb(array).astype(np.float32)
    return pixels(array, [np.float32], np.float32), 1


def color_out(picture: Array, dtype: np.dtype[Any], encoding: str | None) -> Array:
    """Give the delivered picture (uint8, sRGB) in the type and encoding of what came in; floats are 0 to 1."""
    if dtype == np.uint8:
        if encoding == "linear":
            return (_LINEAR_OF_BYTE * 255 + 0.5).astype(np.uint8)[picture]
        return picture
    if encoding == "srgb":
        return (picture / np.float32(255)).astype(dtype, copy=False)
    return _LINEAR_OF_BYTE[picture].astype(dtype, copy=False)


def poses_of(
    given: Any,
    what: str,
    axes: str = "optical",
    direction: str = "world_from_camera",
    quaternion: str = "xyzw",
) -> _core.Poses:
    """Give the library's poses of pairs (time in s, pose), or of a pair (times, poses) of arrays.

    A pose is a 4x4 matrix, or seven numbers: x, y, z and a quaternion in the order of `quaternion`. ArgumentError says what is none.
    """
    if isinstance(given, _core.Poses):
        return given
    if isinstance(given, tuple) and len(given) == 2 and np.ndim(given[0]) == 1 and np.ndim(given[1]) > 1:
        times, values = given
    else:
        pairs: Sequence[Any] = list(given)
        if any(not isinstance(p, Sequence) or len(p) != 2 for p in pairs):
            raise ArgumentError(f"{what} are pairs (time in s, 4x4 matrix or x y z and quaternion)")
        times = [p[0] for p in pairs]
        values = [np.asarray(p[1], dtype=np.float64) for p in pairs]
        if len({v.shape for v in values}) > 1:
            raise ArgumentError(f"{what}: all are matrices, or all are seven numbers")
    stamps = np.ascontiguousarray(times, dtype=np.float64)
    numbers = np.ascontiguousarray(values, dtype=np.float64)
    if numbers.size == 0 or numbers.shape[1:] not in ((4, 4), (16,), (7,)) or len(stamps) != len(numbers):
        shape = f"{stamps.shape} times and poses of the shape {numbers.shape}"
        raise ArgumentError(f"{what}: {shape}: (n) and (n, 4, 4) or (n, 7) are expected")
    form = one_of(FORMS, quaternion, "quaternion") if numbers.shape[1:] == (7,) else FORMS["matrix"]
    numbers = numbers.reshape(len(stamps), -1)
    where = one_of(AXES, axes, "axes"), one_of(DIRECTIONS, direction, "direction")
    return _core.Poses(stamps, numbers, form, *where, 1.0)


_ID_DTYPES = [np.int32, np.uint32, np.uint16, np.uint8]


def depth_in(given: Any) -> Array | None:
    """Give depth as the library reads it. ArgumentError: it is not (height, width)."""
    if given is None:
        return None
    depth = to_numpy(given, "depth")
    if depth.ndim == 3 and depth.shape[2] == 1:
        depth = depth[..., 0]
    if depth.ndim != 2:
        raise ArgumentError(f"depth has the shape {depth.shape}: (height, width) is expected")
    return pixels(depth, [np.float32], np.float32)


def ids_in(given: Any, bodies: Mapping[int, Any] | None) -> Array | None:
    """Give ids as the library reads them, where there are bodies. ArgumentError: they are missing, or not (height, width)."""
    if not bodies:
        return None
    if given is None:
        raise ArgumentError("bodies are given, and no ids: say which pixel shows which body, in each picture")
    ids = to_numpy(given, "ids")
    if ids.ndim == 3 and ids.shape[2] == 1:
        ids = ids[..., 0]
    if ids.ndim != 2 or ids.dtype.kind not in "iu":
        raise ArgumentError(f"ids are {ids.dtype} of the shape {ids.shape}: integers of (height, width) are expected")
    return pixels(ids, _ID_DTYPES, np.int32)
