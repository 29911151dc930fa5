"""Gymnasium: environments of MuJoCo whose observations are what a real camera delivers.

>>> env = shutterbug.gymnasium.CameraWrapper(gymnasium.make("Ant-v5"), shutterbug.Camera.preset("phone"), height=96, width=96)
>>> observation, info = env.reset(seed=1)
>>> observation["pixels"]

What happens between two observations is in the picture: the wrapper keeps the state of each physics step of the frame skip.
"""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from ._arrays import Array
from ._outputs import checked, highest_of, layout_of
from .camera import Camera
from .errors import ArgumentError
from .frame import Frame
from .mujoco import Renderer

# It states no types that checkers know.
mujoco: Any = importlib.import_module("mujoco")

__all__ = ["CameraVectorWrapper", "CameraWrapper"]


def _first_frame(seed: int | None, place: int = 0) -> int:
    """Where the numbers of a seed's frames begin: noise is drawn by number, and seeds are far apart."""
    digest = hashlib.sha256(f"{seed}/{place}".encode()).digest()
    return int.from_bytes(digest[:4], "little")


class _Eye:
    """A renderer of one environment that hears of each of its physics steps."""

    def __init__(self, env: Any, camera: Camera, view: Any, size: tuple[int, int], pictures: int, output: str) -> None:
        base = env.unwrapped
        if not isinstance(getattr(base, "model", None), mujoco.MjModel) or not hasattr(base, "data"):
            raise ArgumentError(f"{base} has no `model` and `data` of MuJoCo: use Camera itself with what your environment renders")
        self.base, self.view = base, view
        self.renderer = Renderer(base.model, *size, camera=camera, pictures=pictures, output=output)
        self._before: Callable[[Any, int], None] | None = getattr(base, "_step_mujoco_simulation", None)
        if self._before is not None:
            base._step_mujoco_simulation = self._step

    def _step(self, ctrl: Any, n_frames: int) -> None:
        assert self._before is not None
        if self.renderer._history.empty:
            self.renderer.record(self.base.data)
        for _ in range(n_frames):
            self._before(ctrl, 1)
            self.renderer.record(self.base.data)

    def begin(self, seed: int | None, place: int = 0) -> None:
        """A new episode: the world has rested, and noise depends on the seed alone."""
        self.renderer.forget()
        if seed is not None:
            self.renderer.next_frame = _first_frame(seed, place)

    def submit(self) -> Frame:
        self.renderer.update_scene(self.base.data, self.view)
        return self.renderer.submit()

    def close(self) -> None:
        if self._before is not None:
            del self.base._step_mujoco_simulation
        self.renderer.close()


def _one(output: Any, size: tuple[int, int]) -> str:
    """The name of the output that goes into observations. ArgumentError: several, no such one, or a width that it cannot pack."""
    names = checked(output, size[1], size[0])
    if len(names) > 1:
        raise ArgumentError(f"output is {', '.join(names)}: an observation holds one of them")
    return next(iter(names), "uint8")


def _box(output: str, size: tuple[int, int]) -> spaces.Box:
    layout = layout_of(output, (*size, 3))
    # Of floats four channels are read, and the picture has three.
    shape = (*size, 3) if output == "float32" else layout.shape
    return spaces.Box(0, highest_of(output), shape, layout.dtype)  # type: ignore[arg-type]


def _with_pixels(space: spaces.Space[Any], key: str, pixels: spaces.Box) -> spaces.Dict:
    if isinstance(space, spaces.Dict):
        return spaces.Dict({**space.spaces, key: pixels})
    return spaces.Dict({"state": space, key: pixels})


def _joined(observation: Any, key: str, picture: Array) -> dict[str, Any]:
    return {**(observation if isinstance(observation, dict) else {"state": observation}), key: picture}


class CameraWrapper(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Adds what the camera delivers to the observations of an environment of MuJoCo.

    An observation that is no dictionary becomes ``{"state": it, key: picture}``. The picture, (height, width, 3) of uint8 or what
    `output` names, is the frame whose last line closes when the observation is made. Same seed at `reset` and same actions, same bits.
    `observation_space` is the environment's with the picture: its shape, type and bounds.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        cam: Camera,
        *,
        key: str = "pixels",
        view: Any = -1,
        height: int | None = None,
        width: int | None = None,
        pictures: int = 1,
        output: Any = None,
    ) -> None:
        """Wrap `env`, an environment of MuJoCo.

        `cam`: its effects and times are used, its size where none is given. `key`: of the picture in the observation. `view`: MuJoCo's
        camera (name, number, MjvCamera). `height`, `width`: px. `pictures` as of `shutterbug.mujoco.Renderer`. `output`: one of
        `shutterbug.Given`'s, such as ``"uint16"``, ``"float32"`` (linear, 0 to 1) or ``"raw12"``; None: uint8, sRGB. ArgumentError: it
        is no environment of MuJoCo, no such output, or several.
        """
        super().__init__(env)
        size = (height or cam.height, width or cam.width)
        self._key, name = key, _one(output, size)
        self._eye = _Eye(env, cam, view, size, pictures, name)
        self.observation_space = _with_pixels(env.observation_space, key, _box(name, size))

    @property
    def renderer(self) -> Renderer:
        """The renderer behind it."""
        return self._eye.renderer

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], dict[str, Any]]:
        """As of the environment, which gets `options`, with the picture. The noise is drawn for `seed`, a whole number, too: same seed,
        same bits. Errors as of `shutterbug.mujoco.Renderer.render`, and the environment's own.
        """
        observation, info = self.env.reset(seed=seed, options=options)
        self._eye.begin(seed)
        return self._seen(observation), info

    def step(self, action: Any) -> tuple[dict[str, Any], Any, bool, bool, dict[str, Any]]:
        """Take `action` as of the environment, and give what that gives, with the picture. Errors as of
        `shutterbug.mujoco.Renderer.render`.
        """
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._seen(observation), reward, terminated, truncated, info

    def _seen(self, observation: Any) -> dict[str, Any]:
        with self._eye.submit() as frame:
            return _joined(observation, self._key, frame.result())

    def close(self) -> None:
        """Close the environment and the camera."""
        self._eye.close()
        super().close()


class CameraVectorWrapper(gymnasium.vector.VectorWrapper):
    """The same for `gymnasium.vector.SyncVectorEnv`: one device for all, with several frames in flight.

    The device works on one environment's frame while the next one is drawn. `single_observation_space` and `observation_space` are the
    environments' with the pictures.
    """

    def __init__(
        self,
        env: gymnasium.vector.SyncVectorEnv,
        cam: Camera,
        *,
        key: str = "pixels",
        view: Any = -1,
        height: int | None = None,
        width: int | None = None,
        pictures: int = 1,
        output: Any = None,
    ) -> None:
        """Wrap environments; arguments as of `CameraWrapper`. ArgumentError: not of MuJoCo, not synchronous, or a camera with
        auto_exposure, which counts an engine's frames.
        """
        super().__init__(env)
        if not isinstance(env, gymnasium.vector.SyncVectorEnv):
            raise ArgumentError("a SyncVectorEnv is expected: in others wrap each environment in a CameraWrapper")
        if "auto_exposure" in cam.effects:
            raise ArgumentError("auto_exposure counts a device's frames: wrap each environment in a CameraWrapper")
        size = (height or cam.height, width or cam.width)
        self._key, self._flight, name = key, 4, _one(output, size)
        # The pinhole is that of the environments: found once, then all share one camera and its device.
        first = _Eye(env.envs[0], cam, view, size, pictures, name)
        first.renderer.update_scene(first.base.data, view)
        k = first.renderer.camera.matrix
        pinhole = {"fx": k[0, 0], "fy": k[1, 1], "cx": k[0, 2], "cy": k[1, 2]}
        self._camera = cam.with_pinhole(size[1], size[0], frames_in_flight=self._flight, **pinhole)
        first.close()
        self._eyes = [_Eye(e, self._camera, view, size, pictures, name) for e in env.envs]
        self.single_observation_space = _with_pixels(env.single_observation_space, key, _box(name, size))
        self.observation_space = gymnasium.vector.utils.batch_space(self.single_observation_space, env.num_envs)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], dict[str, Any]]:
        """As of the environments, with the pictures, (number, height, width, 3) of uint8 or what `output` names. `seed`: one for all, or a
        list of one each. `options`: of the environments. Errors as of `shutterbug.mujoco.Renderer.render`.
        """
        observations, infos = self.env.reset(seed=seed, options=options)
        seeds = seed if isinstance(seed, list | tuple) else [seed] * len(self._eyes)
        for place, (eye, own) in enumerate(zip(self._eyes, seeds, strict=True)):
            eye.begin(own, place)
        return self._seen(observations), infos

    def step(self, actions: Any) -> tuple[dict[str, Any], Any, Any, Any, dict[str, Any]]:
        """Take `actions` as of the environments, and give what that gives, with the pictures as of `reset`. Errors as of
        `shutterbug.mujoco.Renderer.render`.
        """
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        return self._seen(observations), rewards, terminations, truncations, infos

    def _seen(self, observations: Any) -> dict[str, Any]:
        pictures: list[Array] = []
        waiting: list[Frame] = []
        for eye in self._eyes:
            if len(waiting) == self._flight:
                with waiting.pop(0) as frame:
                    pictures.append(frame.result())
            waiting.append(eye.submit())
        for frame in waiting:
            with frame:
                pictures.append(frame.result())
        return _joined(observations, self._key, np.stack(pictures))

    def close(self, **kwargs: Any) -> None:
        """Close the environments, which get `kwargs`, and the camera."""
        for eye in self._eyes:
            eye.close()
        self._camera.close()
        super().close(**kwargs)
