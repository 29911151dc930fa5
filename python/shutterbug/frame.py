"""A frame on its way, or delivered."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from . import _core
from ._arrays import Array, color_out, srgb_of_linear
from ._closing import Closing
from ._outputs import RADIANCE, RGBA32F, Layout, layout_of
from .errors import ArgumentError


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
        outputs: tuple[str, ...] = (),
    ) -> None:
        """For `Camera.submit` alone."""
        self._core, self._size, self._kind, self._like, self._outputs = core, size, kind, like, outputs

    def ready(self) -> bool:
        """Tell whether `result` would return at once. Errors as of `result`."""
        return self._core.ready()

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait for the frame at most `timeout_s`, s (None: ten minutes). Ctrl-C ends the wait and leaves the frame as it is.

        WaitTimeoutError: the time passed; wait again. DeviceLostError, OutOfMemoryError, VulkanError: there will be no frame.
        """
        self._core.wait(-1.0 if timeout_s is None else timeout_s)

    def result(self, out: Array | None = None, timeout_s: float | None = None) -> Any:
        """Give the delivered picture, (height, width, channels) of the camera's size, in the kind, type and encoding of the colour that
        came in; or the first ``output`` that the frame was submitted with, as of `read`.

        uint8 is sRGB, unless the colour was given as ``encoding="linear"``. Floats are 0 to 1 in steps of 8 bits (``output="float32"``
        is not rounded), linear unless the colour was given as ``encoding="srgb"``. With `out`, a C-contiguous uint8 array of that
        shape, the picture is written there, and `out` returned. `timeout_s` as of `wait`. Errors as of `wait`; ArgumentError and ValueError
        where `out` does not fit.
        """
        if self._outputs:
            return self.read(self._outputs[0], out, timeout_s)
        dtype, encoding = self._kind
        if out is not None and (dtype != np.uint8 or encoding == "linear"):
            raise ArgumentError(f"out has to be uint8 of the shape {self._size}, for colour that is uint8 and sRGB")
        picture = self._filled(layout_of("uint8", self._size), out, timeout_s)
        return picture if out is not None else self._like(color_out(picture, dtype, encoding))

    def read(self, output: str, out: Array | None = None, timeout_s: float | None = None) -> Any:
        """Give the frame as one of the outputs that it was submitted with; ``"uint8"`` can be had of each. Repeatable.

        Names, shapes and types as of `Given`'s ``output``. What is delivered is the same, rounded otherwise. With `out`, a C-contiguous
        array of that shape and type (of ``"float32"`` one of four channels, linear), it is written there, and `out` returned.
        StateError: it was not submitted for that output; ArgumentError: no such output, or `out` does not fit. `timeout_s` and errors as of
        `wait`.
        """
        layout = layout_of(output, self._size)
        plane = self._filled(layout, out, timeout_s)
        if out is not None:
            return out
        if layout.format == RGBA32F:
            plane = np.ascontiguousarray(plane[..., : self._size[2]])
            if self._kind[1] == "srgb":
                plane[..., :3] = srgb_of_linear(plane[..., :3])
        return self._like(plane)

    def picture(self, timeout_s: float | None = None) -> Array:
        """Give the delivered picture as it left the camera, (height, width, channels) of uint8, sRGB, in numpy, whatever came in.
        `timeout_s` and errors as of `wait`.
        """
        return self._filled(layout_of("uint8", self._size), None, timeout_s)

    def radiance(self, timeout_s: float | None = None) -> Any:
        """Give what reached the sensor: linear, 1 = white, float32 (height, width, 3), with lens, shutter and blur, before noise and
        encoding. Only of frames submitted with ``radiance=True`` (else StateError). `timeout_s` and errors as of `wait`.
        """
        plane = self._filled(Layout(RADIANCE, RGBA32F, (*self._size[:2], 4), np.float32), None, timeout_s)
        return self._like(np.ascontiguousarray(plane[..., :3]))

    def _filled(self, layout: Layout, out: Array | None, timeout_s: float | None) -> Array:
        if out is not None and (out.shape != layout.shape or out.dtype != layout.dtype):
            kind = np.dtype(layout.dtype).name
            raise ArgumentError(f"out is {out.dtype} of the shape {out.shape}: {kind} of the shape {layout.shape} is expected")
        self.wait(timeout_s)
        filled = np.empty(layout.shape, layout.dtype) if out is None else out
        self._core.read_into(layout.plane, layout.format, filled)
        return filled

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
