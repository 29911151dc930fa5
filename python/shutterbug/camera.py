"""`Camera`: what a real, cheap, moving camera would have delivered of frames that your renderer made."""

from __future__ import annotations

import math
import os
import re
import threading
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from . import _core, _toml
from ._arrays import Array, like, one_of, to_numpy
from ._camera_info import text_of_camera_info
from ._closing import Closing
from ._device import open_engine
from ._given import Given, outside_of
from ._outputs import layout_of, outputs_of
from .errors import ArgumentError, InputError
from .frame import Frame

_METHODS = {"default": 0, "paper": 2, "fast": 4}


def _read(text: str, name: str | None) -> tuple[str, list[str]]:
    """Let the library read the text of a camera.toml, of the file or preset `name`. None: it was made of arguments, and errors name the
    table instead of a line, which whoever gave those does not know.
    """
    try:
        return _core.check_camera(text, "camera" if name is None else name)
    except InputError as error:
        placed = re.match(r"camera:(\d+): ", str(error))
        if name is not None or not placed:
            raise
        above = re.findall(r"^\[(\w+)\]", "\n".join(text.splitlines()[: int(placed[1])]), re.MULTILINE)
        raise InputError(": ".join(["camera", *above[-1:], str(error)[placed.end() :]])) from None


class Camera(Closing):
    """A camera: size, pinhole, frame period, and effects. Call it with a picture of your renderer, and what it would have delivered
    comes back.

    >>> cam = Camera(640, 480, fovy=45, readout_time_s=0.02, exposure_time_s=0.01, effects={"read_noise": {"sigma": 0.01}})
    >>> picture = cam(rgb, depth=z, poses=[(0.0, T0), (0.04, T1)], time=0.0)

    A device is opened with the first frame. Any number of threads may use one camera: their calls take turns, with the interpreter
    let go while they wait. Several cameras are independent of each other. Copies that `fork` or `pickle` make open a device of
    their own. A context manager, which closes the device at its end. `notes`: sentences on what was left out or assumed in reading it.
    """

    def __init__(
        self,
        width: int,
        height: int,
        *,
        fovy: float | None = None,
        fx: float | None = None,
        fy: float | None = None,
        cx: float | None = None,
        cy: float | None = None,
        frame_period_s: float = 1 / 30,
        readout_time_s: float = 0.0,
        exposure_time_s: float = 0.0,
        scan_order: str = "top_to_bottom",
        effects: Mapping[str, Mapping[str, Any]] | None = None,
        **options: Any,
    ) -> None:
        """Make a camera.

        `width`, `height`: px. `fovy`: field of view from top to bottom in degrees, as in MuJoCo; or `fx` and `fy` in px, `fy` being `fx`
        where it is None. `cx`, `cy`: px, the middle unless given; the top left pixel's centre is at (0.5, 0.5). `frame_period_s`: from
        frame to frame, s. `readout_time_s`: number of lines times the delay from line to line, s; 0 is a global shutter.
        `exposure_time_s`: of each line, s; 0 is an instant. `scan_order`: ``"top_to_bottom"``, ``"bottom_to_top"``, ``"left_to_right"``
        or ``"right_to_left"``. `effects`: further tables of a camera.toml, such as ``{"read_noise": {"sigma": 0.01}}``; ``shutterbug
        effects`` lists them.

        `options`, as of all constructors: `device` (index, UUID, part of the name, or ``"bundled"``; None: the best), `seed` of all
        noise (same seed and frame, same bits), `frames_in_flight` (1 to 8, default 2), `method` (``"default"``, ``"fast"`` or
        ``"paper"``), `max_blur_samples` (0: the library's choice), `time_limit_s` (longest wait for the device, 0: 600).

        InputError: a value outside its range, an unknown effect or parameter. ArgumentError: no field of view. TypeError: an unknown
        option.
        """
        if fx is None:
            if fovy is None or not 0 < fovy < 180:
                raise ArgumentError(f"fovy is {fovy}: fx in px, or fovy in degrees between 0 and 180 is expected")
            fx = fy = 0.5 * height / math.tan(math.radians(fovy) / 2)
        tables = {name: dict(values) for name, values in (effects or {}).items()}
        if readout_time_s:
            tables["rolling_shutter"] = {"readout_time_s": float(readout_time_s), "scan_order": scan_order}
        if exposure_time_s:
            tables["motion_blur"] = {"exposure_time_s": float(exposure_time_s)}
        description: dict[str, Any] = {
            "width": width,
            "height": height,
            "fx": float(fx),
            "fy": float(fx if fy is None else fy),
            "cx": width / 2 if cx is None else float(cx),
            "cy": height / 2 if cy is None else float(cy),
            "frame_period_s": float(frame_period_s),
        }
        self._begin(_toml.dumps(description | tables), None, options)

    @classmethod
    def _of_text(cls, text: str, name: str | None, options: Mapping[str, Any], notes: Sequence[str] = ()) -> Camera:
        camera = cls.__new__(cls)
        camera._begin(text, name, options)
        # What reading it says anew has been said where it was read before.
        camera.notes = list(dict.fromkeys([*notes, *camera.notes]))
        return camera

    def _begin(self, text: str, name: str | None, options: Mapping[str, Any]) -> None:
        known = {
            "device": None,
            "seed": 0,
            "frames_in_flight": 2,
            "method": "default",
            "max_blur_samples": 0,
            "time_limit_s": 0.0,
        }
        for option in options:
            if option not in known:
                raise TypeError(f"there is no option {option!r}: {', '.join(known)} are expected")
        self._options: dict[str, Any] = known | dict(options)
        one_of(_METHODS, self._options["method"], "method")
        self._text, self.notes = _read(text, name)
        self._description: dict[str, Any] = tomllib.loads(self._text)
        self._engine: _core.Engine | None = None
        self._lock, self._pid = threading.Lock(), os.getpid()
        self._free = threading.Semaphore(max(1, self._options["frames_in_flight"]))

    # ---- Other ways to make one ------------------------------------------------------------------------------------------

    @classmethod
    def preset(cls, name: str, **options: Any) -> Camera:
        """Give the camera `name` of `shutterbug.presets()`, such as ``"phone"``; `with_pinhole` gives it your size. InputError: no such
        preset.

        `options` as of `Camera`.
        """
        return cls._of_text(_core.preset_text(name), f"preset {name}", options)

    @classmethod
    def from_toml(cls, file: str | os.PathLike[str], **options: Any) -> Camera:
        """Read `file`, a camera.toml. InputError names line, key and range; FileNotFoundError and the like where it cannot be read.

        `options` as of `Camera`.
        """
        return cls._of_text(Path(file).read_text("utf-8"), os.fspath(file), options)

    @classmethod
    def from_camera_info(
        cls,
        info: Any,
        *,
        camera: str | None = None,
        rate_hz: float = 30.0,
        effects: Mapping[str, Mapping[str, Any]] | None = None,
        **options: Any,
    ) -> Camera:
        """Read ROS `camera_info`: a file (also Kalibr's camchain or EuRoC's sensor.yaml), a dictionary, or a message of ROS 1 or 2.

        `info`: the path of the file, the dictionary or the message. `camera` chooses one of several of a camchain. `rate_hz`: frames a
        second, Hz, where the file does not say. `effects`: tables that it cannot hold, such as ``{"rolling_shutter": {"readout_time_s":
        0.02, "scan_order": "top_to_bottom"}}``. `notes` of the camera says what has no place in a camera.toml. Pixel centres are
        converted (theirs are whole numbers). InputError: it holds something that cannot be used. FileNotFoundError and the like: a file
        cannot be read. `options` as of `Camera`.
        """
        if isinstance(info, str | os.PathLike):
            text, name = Path(info).read_text("utf-8"), os.fspath(info)
        else:
            text, name = text_of_camera_info(info), "camera_info"
        toml, notes = _core.import_camera(text, name, None, camera, rate_hz)
        tables = {effect: dict(values) for effect, values in (effects or {}).items()}
        return cls._of_text(_toml.dumps(tomllib.loads(toml) | tables), name, options, notes)

    @classmethod
    def from_gyroflow(cls, profile: str | os.PathLike[str], *, rate_hz: float = 30.0, **options: Any) -> Camera:
        """Read `profile`, a lens profile of Gyroflow (JSON): size, lens (fisheye or OpenCV's standard model), frame rate, readout time.

        `rate_hz`: frames a second, Hz, where the profile does not say. `notes` of the camera says what was left out, and what was assumed.
        The same reader as of ``shutterbug camera convert``. InputError: it is no lens profile, or holds something that cannot be used.
        OSError: it cannot be read. `options` as of `Camera`.
        """
        name = os.fspath(profile)
        toml, notes = _core.import_camera(Path(profile).read_text("utf-8"), name, "gyroflow", None, rate_hz)
        return cls._of_text(toml, name, options, notes)

    def with_pinhole(
        self,
        width: int,
        height: int,
        *,
        fovy: float | None = None,
        fx: float | None = None,
        fy: float | None = None,
        cx: float | None = None,
        cy: float | None = None,
        **options: Any,
    ) -> Camera:
        """Give a camera with the same effects and another size, `width` and `height` in px, and pinhole.

        `fovy`: field of view from top to bottom, degrees; or `fx`, `fy`, px (`fy` None: as `fx`); with neither of them the field of view
        from left to right stays. `cx`, `cy`: px, the middle unless given. Lengths in px, such as ``defocus.sigma_px``, stay as they are.
        `options`, as of `Camera`, replace its own. ArgumentError, InputError: a value outside its range. TypeError: an unknown option.
        """
        scale = width / self.width
        if fx is None and fovy is None:
            fx, fy = self._description["fx"] * scale, self._description["fy"] * scale
        pinhole = {"width", "height", "fx", "fy", "cx", "cy", "frame_period_s"}
        bare = Camera(width, height, fovy=fovy, fx=fx, fy=fy, cx=cx, cy=cy, frame_period_s=self.frame_period_s)
        kept = {name: value for name, value in self._description.items() if name not in pinhole}
        return self._of_text(_toml.dumps(bare._description | kept), None, self._options | options, self.notes)

    def with_effects(self, effects: Mapping[str, Mapping[str, Any] | None], **options: Any) -> Camera:
        """Give a camera with the tables of `effects` in place of its own of the same names; None takes one away. `options`, as of `Camera`,
        replace its own. InputError, TypeError as of `Camera`.
        """
        tables = dict(self._description)
        for name, values in effects.items():
            if values is None:
                tables.pop(name, None)
            else:
                tables[name] = {**tables.get(name, {}), **values}
        return self._of_text(_toml.dumps(tables), None, self._options | options)

    def become(self, other: Camera) -> None:
        """Take the size, pinhole and effects of `other`, another camera, and keep the device, where opening one would take a tenth of a
        second.

        StateError: frames are in flight, and size or pinhole change; then nothing has changed.
        """
        with self._held():
            if self._engine is not None and self._text != other._text:
                self._engine.set_camera(other._text)
            self._text, self._description, self.notes = other._text, other._description, list(other.notes)

    # ---- What it is ------------------------------------------------------------------------------------------------------

    @property
    def width(self) -> int:
        """Width of the picture, px."""
        return int(self._description["width"])

    @property
    def height(self) -> int:
        """Height of the picture, px."""
        return int(self._description["height"])

    @property
    def matrix(self) -> Array:
        """The pinhole as a 3x3 matrix of float64, px; the top left pixel's centre is at (0.5, 0.5)."""
        d = self._description
        return np.array([[d["fx"], 0, d["cx"]], [0, d["fy"], d["cy"]], [0, 0, 1]], np.float64)

    @property
    def fovy(self) -> float:
        """Field of view from top to bottom, degrees, of a principal point in the middle."""
        return math.degrees(2 * math.atan(0.5 * self.height / self._description["fy"]))

    @property
    def frame_period_s(self) -> float:
        """From one frame to the next, s."""
        return float(self._description["frame_period_s"])

    @property
    def readout_time_s(self) -> float:
        """Number of lines times the delay from line to line, s; 0: a global shutter."""
        return float(self._description.get("rolling_shutter", {}).get("readout_time_s", 0.0))

    @property
    def exposure_time_s(self) -> float:
        """How long each line is open, s."""
        return float(self._description.get("motion_blur", {}).get("exposure_time_s", 0.0))

    @property
    def effects(self) -> dict[str, dict[str, Any]]:
        """The tables of its camera.toml, with every parameter; a copy."""
        return {k: dict(v) for k, v in self._description.items() if isinstance(v, dict)}

    @property
    def seed(self) -> int:
        """Seed of all noise, a whole number from 0 on."""
        return int(self._options["seed"])

    @property
    def toml(self) -> str:
        """Its camera.toml."""
        return self._text

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write its camera.toml to `file`. OSError where that cannot be."""
        Path(file).write_text(self._text, "utf-8")

    def span(self, time: float = 0.0) -> tuple[float, float]:
        """Give the times, s, at which a frame's first line opens and its last line closes, for the start `time`, s."""
        start = time + float(self._description.get("time_offset", {}).get("offset_s", 0.0))
        return start, start + self.readout_time_s + self.exposure_time_s

    def middle(self, time: float = 0.0) -> float:
        """Give the time half way through a frame that starts at `time`, both in s: what is rendered then needs the least warping."""
        return 0.5 * sum(self.span(time))

    def __repr__(self) -> str:
        effects = ", ".join(self.effects) or "no effect"
        return f"<shutterbug.Camera {self.width}x{self.height}, {effects}>"

    # ---- Frames ----------------------------------------------------------------------------------------------------------

    def __call__(self, rgb: Any, *, out: Array | None = None, **given: Unpack[Given]) -> Any:
        """Give what the camera would have delivered. Arguments and errors as of `submit`; `out` and the result as of `Frame.result`:
        (height, width, channels) of uint8 or of the kind that came in, or what `output` names: 16 bits, floats, raw numbers behind the
        Bayer filter.
        """
        with self._held():
            free = self._free
        # More threads than frames in flight: they wait here.
        with free, self.submit(rgb, **given) as frame:
            return frame.result(out)

    def submit(self, rgb: Any, **given: Unpack[Given]) -> Frame:
        """Hand a frame to the device and return at once; its `result` is what the camera would have delivered.

        `rgb`: (height, width, 3 or 4) of uint8 (sRGB) or floats (linear, 1 = white), numpy's or anything with DLPack in host memory. It
        may be larger than the camera by a margin, the same on opposite sides: what lens and motion bring in from beyond the picture.
        `given`: what else is known of it; `shutterbug.Given` says what that can be. How it moves is one of three things: `depth` with
        `poses` (and `ids` with `bodies`), or `motion`, or ``still=True``.

        Errors: MissingMotionError (shutter or blur, and none of the three), TooSmallError (the margin, and how large it has to be),
        TimeRangeError (the poses do not reach far enough), ArgumentError (shapes, types, names), InputError (raw outputs without
        ``bayer_mosaic``), UnsupportedError (lens effects with motion; more than 8 bits with ``jpeg``), FullError (`frames_in_flight`
        frames have not been waited for), NoDeviceError, and those of the device: OutOfMemoryError, DeviceLostError, VulkanError.
        TypeError: an argument that `shutterbug.Given` does not know.
        """
        made = to_numpy(rgb, "rgb")
        outside, outputs = outside_of(self, made, given), outputs_of(given.get("output"))
        size = (self.height, self.width, made.shape[2])
        for output in outputs:
            layout_of(output, size)
        core = self._open(given.get("seed")).submit(outside)
        kind = (made.dtype, given.get("encoding"))
        return Frame(core, size, kind, like(rgb), outputs)

    def margin(
        self,
        turn_rate_rad_s: float,
        speed_m_s: float = 0.0,
        nearest_m: float = 0.0,
        color_delay_s: float | None = None,
    ) -> tuple[int, int]:
        """Give the columns and rows (px) that `rgb` needs beyond each side so that frames are never refused.

        For a camera that turns by at most `turn_rate_rad_s`, rad/s, about any axis and moves by at most `speed_m_s`, m/s, with nothing
        that comes in at the border nearer than `nearest_m`, m (0: only turns are reckoned with). `color_delay_s`: `color_time` less
        `time` of the frames to come, s; None: rendered at `middle`. InputError: the lens folds.
        """
        delay = self.middle() if color_delay_s is None else color_delay_s
        return self._open(None).margin(turn_rate_rad_s, speed_m_s, nearest_m, delay)

    def reset_exposure(self) -> None:
        """Let automatic exposure begin anew with the next frame. Opens the device; NoDeviceError: none."""
        self._open(None).reset_exposure()

    @property
    def device(self) -> dict[str, Any]:
        """The device that it runs on: ``name``, ``driver``, ``kind``, ``uuid``, ``frames_in_flight``. Opens it. NoDeviceError: none."""
        return self._open(None).info()

    def close(self) -> None:
        """Wait for what is in flight and free the device. Another frame opens it anew."""
        with self._held():
            engine, self._engine = self._engine, None
        if engine is not None:
            engine.close()

    # ---- Inside ----------------------------------------------------------------------------------------------------------

    def _held(self) -> threading.Lock:
        # A lock that another thread of the parent held stays locked in a forked child for ever: the child takes one of its own, and
        # leaves the parent's engine alone.
        if self._pid != os.getpid():
            self._lock, self._pid, self._engine = threading.Lock(), os.getpid(), None
            self._free = threading.Semaphore(max(1, self._options["frames_in_flight"]))
        return self._lock

    def _open(self, seed: int | None) -> _core.Engine:
        with self._held():
            if seed is not None and seed != self._options["seed"]:
                self._options["seed"] = seed
                self._engine = None
            if self._engine is None:
                o = self._options
                limits = (o["frames_in_flight"], _METHODS[o["method"]], o["max_blur_samples"])
                engine = open_engine(o["device"], o["seed"], limits, o["time_limit_s"])
                engine.set_camera(self._text)
                self._engine = engine
            return self._engine

    def __getstate__(self) -> dict[str, Any]:
        return {"text": self._text, "options": dict(self._options), "notes": list(self.notes)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._begin(state["text"], None, state["options"])
        self.notes = state["notes"]
