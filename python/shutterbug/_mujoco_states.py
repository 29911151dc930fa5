"""States of a simulation over time, and MuJoCo's cameras as poses and pinholes."""

from __future__ import annotations

import copy
import importlib
from bisect import bisect_right
from typing import Any

import numpy as np

from ._arrays import Array

# It states no types that checkers know.
mujoco: Any = importlib.import_module("mujoco")


class History:
    """The states of the last steps. Between two of them each joint moves evenly."""

    def __init__(self, model: Any) -> None:
        """Begin without any."""
        self._model = model
        self.scratch = mujoco.MjData(model)
        self._times: list[float] = []
        self._states: list[tuple[Array, Array, Array]] = []
        # How long states are kept, s: as long as a frame, and a little more.
        self.keep_s = 0.2

    @property
    def empty(self) -> bool:
        """Whether no state was kept yet."""
        return not self._times

    @property
    def now_s(self) -> float:
        """Time of the last state, s."""
        return self._times[-1] if self._times else 0.0

    def add(self, data: Any, whole: bool = False) -> None:
        """Keep a state; `whole`: and all else of `data`, which drawing needs."""
        if whole:
            mujoco.mj_copyData(self.scratch, self._model, data)
        now = float(data.time)
        if self._times and now < self._times[-1]:
            self.clear()
        state = (data.qpos.copy(), data.mocap_pos.copy(), data.mocap_quat.copy())
        if self._times and now == self._times[-1]:
            self._states[-1] = state
            return
        self._times.append(now)
        self._states.append(state)
        old = bisect_right(self._times, now - self.keep_s) - 2
        if old > 16:
            del self._times[:old], self._states[:old]

    def clear(self) -> None:
        """Forget all states."""
        self._times.clear()
        self._states.clear()

    def over(self, begin_s: float, end_s: float) -> list[float]:
        """Times of states that reach over a span: those within, and one or two beyond on each side. Where there are none, the world
        rested.
        """
        first = max(0, bisect_right(self._times, begin_s) - 2)
        times = [t for t in self._times[first:] if t <= end_s + (end_s - begin_s)]
        if times[0] > begin_s:
            times.insert(0, begin_s - 1e-6)
        if times[-1] < end_s or len(times) < 2:
            times.append(max(end_s, times[-1]) + 1e-6)
        return times

    def at(self, time_s: float) -> Any:
        """The state of a time, s, with all that follows from joints, as an MjData that the next call changes."""
        data, model = self.scratch, self._model
        i = bisect_right(self._times, time_s) - 1
        here = self._states[max(i, 0)]
        data.qpos[:], data.mocap_pos[:], data.mocap_quat[:] = here
        if 0 <= i < len(self._times) - 1 and time_s > self._times[i]:
            there, step_s = self._states[i + 1], self._times[i + 1] - self._times[i]
            speed = np.zeros(model.nv)
            mujoco.mj_differentiatePos(model, speed, step_s, here[0], there[0])
            mujoco.mj_integratePos(model, data.qpos, speed, time_s - self._times[i])
            share = (time_s - self._times[i]) / step_s
            data.mocap_pos[:] += share * (there[1] - here[1])
            nearer = np.where((here[2] * there[2]).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
            data.mocap_quat[:] = (1 - share) * here[2] + share * nearer * there[2]
        data.time = time_s
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_camlight(model, data)
        if model.nflex:
            mujoco.mj_flex(model, data)
        if model.ntendon:
            mujoco.mj_tendon(model, data)
        return data


class SeenCamera:
    """A camera of MuJoCo, and for a free one how it stood at each call of `update_scene`."""

    def __init__(self, model: Any, camera: Any) -> None:
        """Take a name, a number or an MjvCamera, which were checked."""
        self._model, self._given = model, camera
        self._scene = mujoco.MjvScene(model, 1)
        self._stood: list[tuple[float, Any]] = []

    def same(self, camera: Any) -> bool:
        """Whether `camera` is what this one was made of."""
        return camera is self._given or (isinstance(camera, str | int) and camera == self._given)

    def seen_at(self, time_s: float, keep_s: float) -> None:
        """Note how a free or tracking camera stands now."""
        if isinstance(self._given, mujoco.MjvCamera):
            if self._stood and time_s < self._stood[-1][0]:
                self._stood.clear()
            self._stood = [s for s in self._stood if s[0] > time_s - 4 * keep_s and s[0] < time_s][-64:]
            self._stood.append((time_s, copy.copy(self._given)))

    def at(self, time_s: float) -> Any:
        """The camera as it stands at a time, s: evenly moved between calls of `update_scene`."""
        if len(self._stood) < 2:
            return self._given
        i = min(max(bisect_right([s[0] for s in self._stood], time_s), 1), len(self._stood) - 1)
        (begin, a), (end, b) = self._stood[i - 1], self._stood[i]
        share = min(max((time_s - begin) / (end - begin), 0.0), 1.0)
        camera = copy.copy(b)
        for name in ("azimuth", "elevation", "distance"):
            setattr(camera, name, getattr(a, name) + share * (getattr(b, name) - getattr(a, name)))
        camera.lookat[:] = np.array(a.lookat) + share * (np.array(b.lookat) - np.array(a.lookat))
        return camera

    def pose(self, data: Any, time_s: float) -> Array:
        """World from camera, 4x4, with x right, y up, z backward: the mean of MuJoCo's two eyes."""
        left, right = self._eyes(data, self.at(time_s))
        forward, up = np.array(left.forward, np.float64), np.array(left.up, np.float64)
        forward /= np.linalg.norm(forward)
        up -= up @ forward * forward
        up /= np.linalg.norm(up)
        pose = np.eye(4)
        pose[:3, :3] = np.column_stack([np.cross(forward, up), up, -forward])
        pose[:3, 3] = (np.array(left.pos, np.float64) + np.array(right.pos, np.float64)) / 2
        return pose

    def pinhole(self, data: Any, width: int, height: int) -> tuple[float, float, float, float]:
        """Give fx, fy, cx, cy, px."""
        return pinhole_of(self._eyes(data, self._given), width, height)

    def _eyes(self, data: Any, camera: Any) -> Any:
        """The cameras of an MjvScene of a state. Nothing else of it is updated."""
        model = self._model
        if not isinstance(camera, mujoco.MjvCamera):
            number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, camera) if isinstance(camera, str) else camera
            camera = mujoco.MjvCamera()
            camera.fixedcamid = number
            if number == -1:
                camera.type = mujoco.mjtCamera.mjCAMERA_FREE
                mujoco.mjv_defaultFreeCamera(model, camera)
            else:
                camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        mujoco.mjv_updateCamera(model, data, camera, self._scene)
        return self._scene.camera


def pinhole_of(cameras: Any, width: int, height: int) -> tuple[float, float, float, float]:
    """Give fx, fy, cx, cy in px of MjvScene's cameras for a picture of that size."""
    eye, other = cameras
    high = eye.frustum_top - eye.frustum_bottom
    half = eye.frustum_width or 0.5 * high * width / height
    center = 0.5 * (eye.frustum_center + other.frustum_center)
    fx, fy = eye.frustum_near * width / (2 * half), eye.frustum_near * height / high
    # MuJoCo's numbers are float32: a camera in the middle is exactly there.
    return (
        float(fx),
        float(fy),
        float(width / 2 * (1 - center / half)),
        float(height * eye.frustum_top / high),
    )


def widen(scene: Any, size: tuple[int, int], margin: tuple[int, int]) -> None:
    """Let the scene's cameras see a margin (columns, rows; px) beyond a picture of `size` (height, width)."""
    tall, wide = 1 + 2 * margin[1] / size[0], 1 + 2 * margin[0] / size[1]
    for eye in scene.camera:
        middle = 0.5 * (eye.frustum_top + eye.frustum_bottom)
        half = 0.5 * (eye.frustum_top - eye.frustum_bottom) * tall
        eye.frustum_top, eye.frustum_bottom = middle + half, middle - half
        if eye.frustum_width:
            eye.frustum_width *= wide
