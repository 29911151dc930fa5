"""MuJoCo: a `Renderer` that delivers what a real camera would have.

>>> renderer = shutterbug.mujoco.Renderer(model, 480, 640, camera=shutterbug.Camera.preset("phone"))
>>> renderer.step(data, 16)                      # in place of mujoco.mj_step(model, data, 16)
>>> renderer.update_scene(data, camera="wrist")
>>> picture = renderer.render()

Colours of MuJoCo are taken for sRGB, and shadows and reflections are part of surfaces: both are assumptions.
"""

from __future__ import annotations

import importlib
import logging
from collections.abc import Callable
from typing import Any

import numpy as np

from ._arrays import Array
from ._closing import Closing
from ._margins import needed
from ._mujoco_states import History, SeenCamera, widen
from ._outputs import checked, read_of
from .camera import Camera
from .errors import ArgumentError, TooSmallError
from .frame import Frame

# It states no types that checkers know.
mujoco: Any = importlib.import_module("mujoco")

__all__ = ["Renderer"]

_log = logging.getLogger("shutterbug")
# Margins grow in such steps, px: each new one makes MuJoCo's renderer anew, which takes a quarter of a second.
_MARGIN_STEP_PX = 16
_MAX_BODIES = 255


class Renderer(Closing):
    """Stands in for `mujoco.Renderer`: `update_scene`, `render`, `close`, depth and segmentation as there.

    The picture of `render` is the frame whose last line has just closed: it ends at the time of `update_scene`, and begins
    a readout and an exposure before (`frame_time_s`). So it needs the states of the steps before: advance with `step`, or call `record`
    after each `mujoco.mj_step`. Where neither is done, motion is a straight line between calls of `update_scene`. Before the first
    state, and after a reset, the world is taken to have rested. `next_frame`: number of the next frame, for which noise is drawn, 0 to
    2**32 - 1; may be set.
    """

    def __init__(
        self,
        model: Any,
        height: int = 240,
        width: int = 320,
        max_geom: int = 10000,
        *,
        camera: Camera,
        pictures: int = 1,
        on_scene: Callable[[Any], None] | None = None,
        output: Any = None,
    ) -> None:
        """Make a renderer.

        `model`: MjModel. `height`, `width`: px. `max_geom` as in MuJoCo. `camera`: its effects and times are used; size and pinhole
        become those of the picture and of MuJoCo's camera. `pictures`: renders a frame at different instants, 1 to 8: more of them
        show what one cannot see. `on_scene`: called with each MjvScene after it was updated and before it is drawn, for geoms of your
        own. `output`: what `render` gives in place of 8 bits, as of `shutterbug.Given`: ``"uint16"``, ``"float32"`` (linear),
        ``"raw12"`` and so on; of several the first, the others by `submit` and `Frame.read`.

        ArgumentError: a number outside its range, no such output, or a width that it cannot pack. NoDeviceError and MuJoCo's own errors
        where nothing can be drawn.
        """
        if not 1 <= pictures <= 8:
            raise ArgumentError(f"pictures is {pictures}: 1 to 8 are expected")
        self._model, self._size, self._max_geom = model, (int(height), int(width)), max_geom
        self._outputs = checked(output, *self._size[::-1])
        self._wanted, self._pictures, self._on_scene = camera, pictures, on_scene
        self._camera: Camera | None = None
        self._pinhole: tuple[float, ...] | None = None
        self._margin = (0, 0)
        self._inner: Any = None
        self._mode = "color"
        self._history = History(model)
        self._view: SeenCamera | None = None
        self._option: Any = None
        # Number of the next frame, for which noise is drawn: 0 to 2**32 - 1.
        self.next_frame = 0
        self._told = False
        self._make_inner((0, 0))

    # ---- As in MuJoCo ----------------------------------------------------------------------------------------------------

    @property
    def model(self) -> Any:
        """The MjModel."""
        return self._model

    @property
    def scene(self) -> Any:
        """The MjvScene. It is updated anew for each picture: add geoms by `on_scene`."""
        return self._inner.scene

    @property
    def height(self) -> int:
        """Height of the picture, px."""
        return self._size[0]

    @property
    def width(self) -> int:
        """Width of the picture, px."""
        return self._size[1]

    def enable_depth_rendering(self) -> None:
        """Let `render` give depth, (height, width) of float32, m, at the frame's middle, without the camera's effects."""
        self._mode = "depth"

    def disable_depth_rendering(self) -> None:
        """Let `render` give the picture."""
        self._mode = "color"

    def enable_segmentation_rendering(self) -> None:
        """Let `render` give (id, type) of the object at each pixel, (height, width, 2) of int32, as `enable_depth_rendering`."""
        self._mode = "segmentation"

    def disable_segmentation_rendering(self) -> None:
        """Let `render` give the picture."""
        self._mode = "color"

    def update_scene(self, data: Any, camera: Any = -1, scene_option: Any = None) -> None:
        """Say what is to be seen: the state of `data`, which is copied, through `camera` (name, number or MjvCamera).

        `scene_option`: MuJoCo's MjvOption, what is drawn; None: its defaults.

        ValueError: there is no such camera.
        """
        # MuJoCo's own check of the camera, and its errors.
        self._inner.update_scene(data, camera, scene_option)
        if self._view is None or not self._view.same(camera):
            self._view = SeenCamera(self._model, camera)
        self._history.add(data, whole=True)
        self._view.seen_at(float(data.time), self._history.keep_s)
        self._option = scene_option

    def render(self, *, out: Array | None = None) -> Array:
        """Give the picture, (height, width, 3) of uint8, sRGB, or what `output` names; into `out`, where that is given, an array of the
        same shape, of that type or one that takes its numbers (float64). Depth or segmentation where they are enabled.

        RuntimeError: after `close`, or before `update_scene`. Else errors of `Camera.submit`.
        """
        if self._mode != "color" and self._inner is not None and self._view is not None:
            return self._plain(out)
        with self.submit() as frame:
            return read_of(frame, self._outputs, out)

    def submit(self) -> Frame:
        """Draw, hand the frame to the device and return: its `result` is what `render` gives. Errors as of `render`, and FullError."""
        if self._inner is None or self._view is None:
            raise RuntimeError("render cannot be called after close, or before update_scene")
        camera, time_s = self._fitted(), self.frame_time_s
        states = self._history.over(*camera.span(time_s))
        while True:
            try:
                frame = self._deliver(camera, time_s, states)
            except TooSmallError:
                if not self._grow_margin():
                    raise
            else:
                self.next_frame = (self.next_frame + 1) % 2**32
                return frame

    def close(self) -> None:
        """Free what it has."""
        if self._inner is not None:
            self._inner.close()
        self._close_own_camera()
        self._inner = self._camera = None

    # ---- What MuJoCo has not ---------------------------------------------------------------------------------------------

    def step(self, data: Any, nstep: int = 1) -> None:
        """Advance the physics of `data` by `nstep` steps as `mujoco.mj_step` does, and keep the state of each."""
        if self._history.empty:
            self.record(data)
        for _ in range(nstep):
            mujoco.mj_step(self._model, data)
            self.record(data)

    def record(self, data: Any) -> None:
        """Keep the state of `data` (copied): call it after each step that you make yourself. A time before the last one begins anew."""
        camera = self._camera or self._wanted
        self._history.keep_s = sum(abs(t) for t in camera.span()) + 4 * float(self._model.opt.timestep)
        self._history.add(data)

    def forget(self) -> None:
        """Forget all states: the world has rested until the next one. Automatic exposure begins anew. NoDeviceError: its device is gone."""
        self._history.clear()
        if self._camera is not None and "auto_exposure" in self._camera.effects:
            self._camera.reset_exposure()

    @property
    def frame_time_s(self) -> float:
        """Start of exposure of the first line of the frame that `render` gives, s on the simulation's clock."""
        camera = self._camera or self._wanted
        return self._history.now_s - camera.span()[1]

    @property
    def camera(self) -> Camera:
        """The camera as it is used: with the size of the picture and the pinhole of MuJoCo's camera. RuntimeError before `update_scene`."""
        return self._fitted()

    # ---- Inside ----------------------------------------------------------------------------------------------------------

    def _make_inner(self, margin: tuple[int, int]) -> None:
        """MuJoCo's own renderer, wider by a margin (columns, rows). The model's largest size is put back as it was."""
        if self._inner is not None:
            self._inner.close()
        # The library takes no margin wider than the camera.
        x, y = (-(-m // _MARGIN_STEP_PX) * _MARGIN_STEP_PX for m in margin)
        self._margin = (min(x, self.width), min(y, self.height))
        height, width = self._size[0] + 2 * self._margin[1], self._size[1] + 2 * self._margin[0]
        room = self._model.vis.global_
        own = room.offwidth, room.offheight
        try:
            room.offwidth, room.offheight = max(own[0], width), max(own[1], height)
            self._inner = mujoco.Renderer(self._model, height, width, self._max_geom)
        finally:
            room.offwidth, room.offheight = own

    def _grow_margin(self) -> bool:
        """Half as much again on each side; False where it is as wide as the picture already."""
        before = self._margin
        x, y = (m + max(_MARGIN_STEP_PX, m // 2) for m in before)
        self._make_inner((min(x, self.width), min(y, self.height)))
        return self._margin != before

    def _fitted(self) -> Camera:
        if self._inner is None or self._view is None:
            raise RuntimeError("nothing was seen yet: call update_scene first")
        pinhole = self._view.pinhole(self._history.scratch, self.width, self.height)
        if self._camera is None or pinhole != self._pinhole:
            self._close_own_camera()
            fx, fy, cx, cy = pinhole
            self._camera = self._wanted.with_pinhole(self.width, self.height, fx=fx, fy=fy, cx=cx, cy=cy)
            if self._camera.toml == self._wanted.toml:
                # Renderers that share a camera share its device.
                self._camera = self._wanted
            self._pinhole = pinhole
        return self._camera

    def _close_own_camera(self) -> None:
        if self._camera is not None and self._camera is not self._wanted:
            self._camera.close()

    def _draw(self, time_s: float, mode: str) -> Array:
        """Colour, depth or segmentation of an instant, with the margin."""
        assert self._view is not None
        data = self._history.at(time_s)
        inner = self._inner
        inner.update_scene(data, self._view.at(time_s), self._option)
        widen(inner.scene, self._size, self._margin)
        if self._on_scene is not None:
            self._on_scene(inner.scene)
        if mode == "depth":
            inner.enable_depth_rendering()
        elif mode == "segmentation":
            inner.enable_segmentation_rendering()
        try:
            seen: Array = inner.render()
        finally:
            inner.disable_depth_rendering()
            inner.disable_segmentation_rendering()
        return seen

    def _plain(self, out: Array | None) -> Array:
        x, y = self._margin
        seen = self._draw(self._fitted().middle(self.frame_time_s), self._mode)
        seen = np.ascontiguousarray(seen[y : y + self.height, x : x + self.width])
        if out is None:
            return seen
        np.copyto(out, seen, casting="unsafe")
        return out

    def _shot(self, time_s: float) -> tuple[float, Array, Array, Array]:
        color, depth, objects = (self._draw(time_s, mode) for mode in ("color", "depth", "segmentation"))
        ids = self._bodies_of(objects)
        # The sky is drawn at the far plane: it turns with the camera, and is nowhere.
        depth[objects[..., 0] < 0] = np.inf
        return time_s, color, depth, ids

    def _bodies_of(self, objects: Array) -> Array:
        """Which body each pixel shows: bodies that are welded together are one, 0 is the world."""
        model, kinds = self._model, mujoco.mjtObj
        ids = np.zeros(objects.shape[:2], np.int32)
        known = objects[..., 0] < 0
        for kind, body in ((kinds.mjOBJ_GEOM, model.geom_bodyid), (kinds.mjOBJ_SITE, model.site_bodyid)):
            here = (objects[..., 1] == int(kind)) & (objects[..., 0] >= 0)
            ids[here] = model.body_weldid[body[objects[..., 0][here]]]
            known |= here
        if not self._told and not known.all():
            self._told = True
            _log.warning("tendons, flexes and skins are taken to rest in the world: they move in no rigid way")
        return ids

    def _deliver(self, camera: Camera, time_s: float, states: list[float]) -> Frame:
        begin, end = camera.span(time_s)
        count = self._pictures
        instants = [begin + (end - begin) * (k + 0.5) / count for k in range(count)]
        shots = [self._shot(t) for t in instants]
        poses, bodies = self._motion(states, {int(i) for s in shots for i in np.unique(s[3])})
        wanted, nearest_m = needed(camera, poses, shots[0][2], self._margin, instants[0] - time_s)
        if wanted[0] > self._margin[0] or wanted[1] > self._margin[1]:
            self._make_inner((max(wanted[0], self._margin[0]), max(wanted[1], self._margin[1])))
            shots = [self._shot(t) for t in instants]
        (when, rgb, depth, ids), *further = shots
        return camera.submit(
            rgb,
            depth=depth,
            ids=ids,
            bodies=bodies,
            poses=poses,
            axes="opengl",
            quaternion="wxyz",
            pictures=further,
            time=time_s,
            color_time=when,
            frame=self.next_frame,
            nearest_m=nearest_m,
            output=self._outputs,
        )

    def _motion(self, states: list[float], seen: set[int]) -> tuple[Any, dict[int, Any]]:
        """The camera's poses over the frame, and those of each body that is seen and moves."""
        assert self._view is not None
        poses, positions, turns = [], [], []
        for time_s in states:
            data = self._history.at(time_s)
            poses.append(self._view.pose(data, time_s))
            positions.append(data.xpos.copy())
            turns.append(data.xquat.copy())
        where = np.concatenate([np.array(positions), np.array(turns)], axis=2)
        moves = np.ptp(where, axis=0).max(axis=1)
        bodies = sorted((b for b in seen if b > 0 and moves[b] > 0), key=lambda b: -moves[b])
        if len(bodies) > _MAX_BODIES:
            _log.warning("%d bodies move in this frame: the %d that move most are followed", len(bodies), _MAX_BODIES)
        times = np.array(states)
        return (times, np.array(poses)), {b: (times, where[:, b]) for b in bodies[:_MAX_BODIES]}
