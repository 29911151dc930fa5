"""A frame on its way, or delivered."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from . import _core
from ._arrays import Array, color_out
from ._closing import Closing
from .errors import ArgumentError

_PICTURE, _RADIANCE = 1, 5


class Frame(Closing):
    """What `Camera.submit` gives: ask it for its result when you need it. A context manager, which frees it at its end.

    Frames may be asked for in any order and from any thread. One that nobody asks for is freed with the last reference to it.
    """

    def __init__(
        self,
        core: _core.Frame,
        size: tuple[int, int, int],
        kind: tuple[np.dtype[Any], str | None],
        like: Callable[[Array], Any],
    ) -> None:
        """For `Camera.submit` alone."""
        self._core, self._size, self._kind, self._like = core, size, kind, like

    def ready(self) -> bool:
        """Tell whether `result` would return at once. Errors as of `result`."""
        return self._core.ready()

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait for the frame, s (None: as long as ten minutes). Ctrl-C ends the wait and leaves the frame as it is.

        WaitTimeoutError: the time passed; wait again. DeviceLostError, OutOfMemoryError, VulkanError: there will be no frame.
        """
        self._core.wait(-1.0 if timeout_s is None else timeout_s)

    def result(self, out: Array | None = None, timeout_s: float | None = None) -> Any:
        """Give the delivered picture, (height, width, channels) of the camera's size, in the kind, type and encoding of the colour that
        came in.

        uint8 is sRGB, unless the colour was given as ``encoding="linear"``. Floats are 0 to 1 in steps of the sensor's output of 8 bits,
        linear unless the colour was given as ``encoding="srgb"``. With `out`, a C-contiguous uint8 array of that shape, the
        picture is written there, and `out` returned. Errors as of `wait`; ArgumentError and ValueError where `out` does not fit.
        """
        self.wait(timeout_s)
        dtype, encoding = self._kind
        plain = dtype == np.uint8 and encoding != "linear"
        if out is not None and (not plain or out.shape != self._size or out.dtype != np.uint8):
            raise ArgumentError(f"out has to be uint8 of the shape {self._size}, for colour that is uint8 and sRGB")
        picture = np.empty(self._size, np.uint8) if out is None else out
        self._core.read_into(_PICTURE, picture)
        return picture if out is not None else self._like(color_out(picture, dtype, encoding))

    def picture(self, timeout_s: float | None = None) -> Array:
        """Give the delivered picture as it left the camera, uint8 and sRGB, in numpy, whatever came in. Errors as of `wait`."""
        self.wait(timeout_s)
        picture = np.empty(self._size, np.uint8)
        self._core.read_into(_PICTURE, picture)
        return picture

    def radiance(self, timeout_s: float | None = None) -> Any:
        """Give what reached the sensor: linear, 1 = white, float32 (height, width, 3), with lens, shutter and blur, before noise and
        encoding. Only of frames submitted with ``radiance=True`` (else StateError). Errors as of `wait`.
        """
        self.wait(timeout_s)
        plane = np.empty((*self._size[:2], 4), np.float32)
        self._core.read_into(_RADIANCE, plane)
        return self._like(np.ascontiguousarray(plane[..., :3]))

    @property
    def info(self) -> dict[str, Any]:
        """When it was taken, after it was waited for (else StateError): ``first_line_start``, ``middle`` and ``last_line_end`` (each a
        time in s and the camera's pose x, y, z, qx, qy, qz, qw there, or None), ``host_ms``, ``exposure_gain``.
        """
        return self._core.info()

    @property
    def times_ms(self) -> dict[str, float]:
        """Passes on the device and their times, ms, after it was waited for (else StateError); empty without timestamps."""
        return dict(self._core.times())

    def close(self) -> None:
        """Free the frame; one in flight is waited for."""
        self._core.close()
