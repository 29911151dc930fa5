"""Newton: its camera sensor as a real camera. Colour is linear from the start (its HDR image), so nothing is assumed of it.

>>> eye = shutterbug.newton.SensorCamera(model, shutterbug.Camera(320, 240, fovy=50, readout_time_s=0.02), body=3, place=pose)
>>> eye.record(state, time_s)                # after each step
>>> picture = eye.render()
"""

from __future__ import annotations

import importlib
from bisect import bisect_right
from collections.abc import Callable
from typing import Any

import numpy as np

from ._arrays import Array
from ._closing import Closing
from ._margins import needed
from ._outputs import checked, read_of
from .camera import Camera
from .errors import ArgumentError, TooSmallError
from .frame import Frame

# They state no types that checkers know.
_newton: Any = importlib.import_module("newton")
_sensors: Any = importlib.import_module("newton.sensors")
_warp: Any = importlib.import_module("warp")

__all__ = ["SensorCamera"]

_MARGIN_STEP_PX = 8
_MAX_BODIES = 255


class SensorCamera(Closing):
    """A camera of Newton that delivers what a real one would have.

    The picture of `render` is the frame whose last line has just closed: it ends at the time of the last `record`, and begins a readout
    and an exposure before. Before the first state the world is taken to have rested. One world is seen, the model's first. `next_frame`:
    number of the next frame, for which noise is drawn, 0 to 2**32 - 1; may be set.
    """

    def __init__(
        self,
        model: Any,
        camera: Camera,
        *,
        body: int = -1,
        place: Any = None,
        pictures: int = 1,
        samples: int = 1,
        render_config: Any = None,
        sensor: Any = None,
        output: Any = None,
    ) -> None:
        """Make a camera.

        `model`: newton.Model. `camera`: size, pinhole, effects. `body`: number of the body that it sits on, -1 the world. `place`: body
        from camera, 4x4, with x right, y up, z backward as in Newton (None: where the body is); or a function of the time in s that gives
        world from camera. `pictures`: renders a frame, 1 to 8. `samples`: rays a pixel, a square number. `render_config`, `sensor`:
        Newton's own, where other than its defaults are wanted. `output`: what `render` gives in place of 8 bits, as of `shutterbug.Given`:
        ``"uint16"``, ``"float32"`` (linear), ``"raw12"`` and so on; of several the first, the others by `submit` and `Frame.read`.
        ArgumentError: a number outside its range, no such output, or a width that it cannot pack.
        """
        if not 1 <= pictures <= 8 or not -1 <= body < model.body_count or round(samples**0.5) ** 2 != samples:
            raise ArgumentError(f"pictures {pictures} is 1 to 8, body {body} -1 to {model.body_count - 1}, samples {samples} a square")
        self._model, self._camera, self._pictures, self._side = model, camera, pictures, round(samples**0.5)
        self._outputs = checked(output, camera.width, camera.height)
        self._body, self._place = body, place if callable(place) else np.eye(4) if place is None else np.asarray(place, float)
        self._sensor = sensor or _sensors.SensorCamera(model)
        # Newton's own default is the sensor's.
        self._config = render_config
        if samples > 1 and render_config is None:
            kind = _sensors.SensorCamera
            self._config = kind.RenderConfig(anti_aliasing=kind.AntiAliasing.SSAA)
        self._state = model.state()
        self._shape_body = model.shape_body.numpy()
        self._times: list[float] = []
        self._poses: list[Array] = []
        self._margin = (0, 0)
        self._rays: Any = None
        # Number of the next frame, for which noise is drawn: 0 to 2**32 - 1.
        self.next_frame = 0

    # ---- States ----------------------------------------------------------------------------------------------------------

    def record(self, state: Any, time_s: float) -> None:
        """Keep the bodies of `state` at `time_s`, s (copied): call it after each step. A time before the last one begins anew."""
        if self._times and time_s < self._times[-1]:
            self.forget()
        poses = np.array(state.body_q.numpy(), np.float64, copy=True) if self._model.body_count else np.zeros((0, 7))
        if self._times and time_s == self._times[-1]:
            self._poses[-1] = poses
            return
        self._times.append(float(time_s))
        self._poses.append(poses)
        begin, end = self._camera.span()
        old = bisect_right(self._times, time_s - (end - min(begin, 0.0)) - 0.1) - 2
        if old > 16:
            del self._times[:old], self._poses[:old]

    def forget(self) -> None:
        """Forget all states: the world has rested until the next one."""
        self._times.clear()
        self._poses.clear()

    @property
    def frame_time_s(self) -> float:
        """Start of exposure of the first line of the frame that `render` gives, s."""
        return (self._times[-1] if self._times else 0.0) - self._camera.span()[1]

    # ---- Frames ----------------------------------------------------------------------------------------------------------

    def render(self) -> Array:
        """Give the picture, (height, width, 3) of uint8, sRGB, or what `output` names. RuntimeError: before `record`. Else errors of
        `Camera.submit`.
        """
        with self.submit() as frame:
            return read_of(frame, self._outputs)

    def submit(self) -> Frame:
        """Draw, hand the frame to the device and return; `Frame.picture` and `Frame.read` give it. Errors as of `render`, and FullError."""
        if not self._times:
            raise RuntimeError("nothing was seen yet: call record first")
        time_s = self.frame_time_s
        begin, end = self._camera.span(time_s)
        while True:
            try:
                frame = self._deliver(time_s, begin, end)
            except TooSmallError:
                before = self._margin
                self._widen((before[0] * 3 // 2 + _MARGIN_STEP_PX, before[1] * 3 // 2 + _MARGIN_STEP_PX))
                if self._margin == before:
                    raise
            else:
                self.next_frame = (self.next_frame + 1) % 2**32
                return frame

    def close(self) -> None:
        """Free the device."""
        self._camera.close()

    # ---- Inside ----------------------------------------------------------------------------------------------------------

    def _deliver(self, time_s: float, begin: float, end: float) -> Frame:
        count = self._pictures
        instants = [begin + (end - begin) * (k + 0.5) / count for k in range(count)]
        shots = [self._shot(t) for t in instants]
        times = self._over(begin, end)
        bodies = np.array([self._bodies(t) for t in times])
        stamps = np.array(times)
        poses = (stamps, np.array([self._pose(t, b) for t, b in zip(times, bodies, strict=True)]))
        wanted, nearest_m = needed(self._camera, poses, shots[0][2], self._margin, instants[0] - time_s)
        if wanted[0] > self._margin[0] or wanted[1] > self._margin[1]:
            self._widen((max(wanted[0], self._margin[0]), max(wanted[1], self._margin[1])))
            shots = [self._shot(t) for t in instants]
        moves = np.ptp(bodies, axis=0).max(axis=1) if bodies.size else np.zeros(0)
        seen = {int(i) - 1 for shot in shots for i in np.unique(shot[3])} - {-1}
        most = sorted((b for b in seen if moves[b] > 0), key=lambda b: -moves[b])[:_MAX_BODIES]
        (when, rgb, depth, ids), *further = shots
        return self._camera.submit(
            rgb,
            depth=depth,
            ids=ids,
            bodies={b + 1: (stamps, bodies[:, b]) for b in most},
            poses=poses,
            axes="opengl",
            pictures=further,
            time=time_s,
            color_time=when,
            frame=self.next_frame,
            nearest_m=nearest_m,
            output=self._outputs,
        )

    def _over(self, begin: float, end: float) -> list[float]:
        """Times of states that reach over a span; where there are none, the world rested."""
        first = max(0, bisect_right(self._times, begin) - 2)
        times = self._times[first:]
        if times[0] > begin:
            times = [begin - 1e-6, *times]
        if len(times) < 2 or times[-1] < end:
            times = [*times, max(end, times[-1]) + 1e-6]
        return times

    def _bodies(self, time_s: float) -> Array:
        """Position and quaternion (x y z w) of each body, (n, 7): even motion between states, rotation on the shorter arc."""
        i = bisect_right(self._times, time_s) - 1
        if i < 0 or i == len(self._times) - 1:
            return self._poses[max(i, 0)]
        a, b = self._poses[i], self._poses[i + 1]
        share = (time_s - self._times[i]) / (self._times[i + 1] - self._times[i])
        cosine = (a[:, 3:] * b[:, 3:]).sum(axis=1, keepdims=True)
        other = np.where(cosine < 0, -b[:, 3:], b[:, 3:])
        angle = np.arccos(np.clip(np.abs(cosine), 0, 1))
        sine = np.where(angle < 1e-6, 1, np.sin(angle))
        turn = np.where(
            angle < 1e-6,
            (1 - share) * a[:, 3:] + share * other,
            (np.sin((1 - share) * angle) * a[:, 3:] + np.sin(share * angle) * other) / sine,
        )
        return np.hstack([(1 - share) * a[:, :3] + share * b[:, :3], turn / np.linalg.norm(turn, axis=1, keepdims=True)])

    def _pose(self, time_s: float, bodies: Array) -> Array:
        """World from camera, 4x4, with x right, y up, z backward."""
        place: Callable[[float], Any] | Array = self._place
        if callable(place):
            return np.asarray(place(time_s), float)
        return place if self._body < 0 else _matrix(bodies[self._body]) @ place

    def _widen(self, margin: tuple[int, int]) -> None:
        x, y = (-(-m // _MARGIN_STEP_PX) * _MARGIN_STEP_PX for m in margin)
        self._margin = (min(x, self._camera.width), min(y, self._camera.height))
        self._rays = None

    def _ray_table(self) -> Any:
        """Rays of the pinhole with the margin, (height, width, samples, 2) of vec3: y up, z backward."""
        if self._rays is None:
            k, (x, y), side = self._camera.matrix, self._margin, self._side
            height, width = self._camera.height + 2 * y, self._camera.width + 2 * x
            inside = (np.arange(side) + 0.5) / side
            v, u, b, a = np.meshgrid(np.arange(height), np.arange(width), inside, inside, indexing="ij")
            rays = np.zeros((height, width, side * side, 2, 3), np.float32)
            across = (u + a - x - k[0, 2]) / k[0, 0]
            down = (v + b - y - k[1, 2]) / k[1, 1]
            shape = (height, width, side * side)
            rays[..., 1, 0], rays[..., 1, 1], rays[..., 1, 2] = across.reshape(shape), -down.reshape(shape), -1
            rays[..., 1, :] /= np.linalg.norm(rays[..., 1, :], axis=-1, keepdims=True)
            self._rays = _warp.array(rays, dtype=_warp.vec3f, device=self._model.device)
        return self._rays

    def _shot(self, time_s: float) -> tuple[float, Array, Array, Array]:
        """Time, linear colour, depth in m and ids (body + 1) of an instant."""
        bodies = self._bodies(time_s)
        if len(bodies):
            self._state.body_q.assign(bodies.astype(np.float32))
        rays = self._ray_table()
        height, width = rays.shape[:2]
        sensor = self._sensor
        color = sensor.allocate_image_color_hdr(1, width, height)
        depth = sensor.allocate_image_depth_forward(1, width, height)
        shapes = sensor.allocate_image_shape_index(1, width, height)
        at = _warp.array([_transform(self._pose(time_s, bodies))], dtype=_warp.transformf, device=self._model.device)
        self._model.bvh_refit_shapes(self._state)
        images = {"hdr_color_image": color, "forward_depth_image": depth, "shape_index_image": shapes}
        sensor.update(self._state, at, rays, render_config=self._config, **images)
        found = shapes.numpy()[0].astype(np.int64)
        nothing = found >= len(self._shape_body)
        ids = np.where(nothing, 0, self._shape_body[np.where(nothing, 0, found)] + 1).astype(np.int32)
        metres = np.where(nothing | ~(depth.numpy()[0] > 0), np.float32(np.inf), depth.numpy()[0])
        return time_s, color.numpy()[0], metres, ids


def _matrix(pose: Array) -> Array:
    x, y, z, w = pose[3:] / np.linalg.norm(pose[3:])
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = pose[:3]
    return matrix


def _transform(matrix: Array) -> Any:
    turn = _warp.quat_from_matrix(_warp.mat33(*matrix[:3, :3].astype(np.float32).ravel().tolist()))
    return _warp.transform(_warp.vec3(*matrix[:3, 3].tolist()), turn)
