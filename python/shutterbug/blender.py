"""Blender: an animation (bpy, Cycles) as a real camera would have filmed it.

>>> eye = shutterbug.blender.Renderer(bpy.context.scene, shutterbug.Camera.preset("phone"))
>>> picture = eye.render(time_s=0.5)

Blender's own motion blur is left off; colour is taken linear, before the view transform, so 1 is white.
"""

from __future__ import annotations

import contextlib
import importlib
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ._arrays import Array
from ._closing import Closing
from ._exr import read_exr
from ._margins import needed
from ._outputs import checked, read_of
from .camera import Camera
from .errors import ArgumentError, TooSmallError
from .frame import Frame

# It states no types that checkers know.
_bpy: Any = importlib.import_module("bpy")

__all__ = ["Renderer"]

_MARGIN_STEP_PX = 8
_MAX_BODIES = 255


class Renderer(Closing):
    """Renders frames of a scene's animation. The animation is known before and after each frame, so nothing has to be recorded.

    Objects that move rigidly are followed by their matrices; what bends or changes its size is taken to rest in its object. The scene's
    settings are put back after each frame.
    """

    def __init__(self, scene: Any, camera: Camera, *, pictures: int = 1, poses: int = 9, output: Any = None) -> None:
        """Make a renderer.

        `scene`: bpy.types.Scene with a perspective camera; its resolution is the picture's. `camera`: its effects and times. `pictures`:
        renders a frame, 1 to 8. `poses`: how many instants the animation is asked for over a frame, 2 or more. `output`: what `render`
        gives in place of 8 bits, as of `shutterbug.Given`: ``"uint16"``, ``"float32"`` (linear), ``"raw12"`` and so on; of several the
        first, the others by `submit` and `Frame.read`. ArgumentError: a number outside its range, no such camera or output, or a width
        that it cannot pack.
        """
        if not 1 <= pictures <= 8 or poses < 2:
            raise ArgumentError(f"pictures is {pictures}, poses {poses}: 1 to 8, and 2 or more are expected")
        eye = scene.camera
        if eye is None or eye.data.type != "PERSP":
            raise ArgumentError("the scene has no perspective camera")
        self._scene, self._pictures, self._poses = scene, pictures, poses
        render = scene.render
        self._size = (render.resolution_x * render.resolution_percentage // 100, render.resolution_y * render.resolution_percentage // 100)
        self._outputs = checked(output, *self._size)
        self._camera = self._fitted(camera)
        self._margin = (0, 0)

    @property
    def camera(self) -> Camera:
        """The camera as it is used: with the scene's size and pinhole."""
        return self._camera

    def render(self, time_s: float, frame: int = 0) -> Array:
        """Give the frame whose first line opens at `time_s`, s from the scene's frame 0: (height, width, 3) of uint8, sRGB, or what
        `output` names.

        `frame`: number for which noise is drawn. Errors of `Camera.submit`, and RuntimeError where Blender cannot render.
        """
        with self.submit(time_s, frame) as made:
            return read_of(made, self._outputs)

    def submit(self, time_s: float, frame: int = 0) -> Frame:
        """Render, hand the frame to the device and return; `Frame.picture` and `Frame.read` give it. Arguments and errors as of `render`;
        and FullError.
        """
        with self._settings():
            while True:
                try:
                    return self._deliver(float(time_s), frame)
                except TooSmallError:
                    before = self._margin
                    self._widen((before[0] * 3 // 2 + _MARGIN_STEP_PX, before[1] * 3 // 2 + _MARGIN_STEP_PX))
                    if self._margin == before:
                        raise

    def close(self) -> None:
        """Free the device."""
        self._camera.close()

    # ---- Inside ----------------------------------------------------------------------------------------------------------

    def _fitted(self, camera: Camera) -> Camera:
        width, height = self._size
        graph = _bpy.context.evaluated_depsgraph_get()
        p = self._scene.camera.calc_matrix_camera(graph, x=width, y=height)
        pinhole = {"fx": p[0][0] * width / 2, "fy": p[1][1] * height / 2}
        # Blender's picture goes from -1 to 1, up.
        return camera.with_pinhole(width, height, cx=(1 - p[0][2]) * width / 2, cy=(1 + p[1][2]) * height / 2, **pinhole)

    @contextlib.contextmanager
    def _settings(self) -> Iterator[None]:
        """Sets what is needed, and puts everything back."""
        scene, layer, eye = self._scene, self._scene.view_layers[0], self._scene.camera.data
        places = [
            (scene.render, "resolution_x"), (scene.render, "resolution_y"), (scene.render, "resolution_percentage"),
            (scene.render, "use_motion_blur"), (scene.render, "filepath"), (scene.render.image_settings, "media_type"),
            (scene.render.image_settings, "file_format"), (scene.render.image_settings, "color_depth"),
            (scene.render.image_settings, "exr_codec"), (scene.render.image_settings, "use_exr_interleave"),
            (layer, "use_pass_z"), (layer, "use_pass_object_index"),
            (eye, "sensor_fit"), (eye, "sensor_width"), (eye, "sensor_height"), (eye, "shift_x"), (eye, "shift_y"),
        ]  # fmt: skip
        before = [(owner, name, getattr(owner, name)) for owner, name in places if hasattr(owner, name)]
        indices = [(o, o.pass_index) for o in scene.objects]
        now = (scene.frame_current, scene.frame_subframe)
        try:
            scene.render.use_motion_blur = False
            layer.use_pass_z = layer.use_pass_object_index = True
            for number, (thing, _) in enumerate(indices, 1):
                thing.pass_index = number
            yield
        finally:
            for owner, name, value in before:
                setattr(owner, name, value)
            for thing, index in indices:
                thing.pass_index = index
            scene.frame_set(now[0], subframe=now[1])

    def _go_to(self, time_s: float) -> None:
        frame = time_s * self._scene.render.fps / self._scene.render.fps_base
        whole = int(np.floor(frame))
        self._scene.frame_set(whole, subframe=min(frame - whole, 0.999999))

    def _widen(self, margin: tuple[int, int]) -> None:
        x, y = (-(-m // _MARGIN_STEP_PX) * _MARGIN_STEP_PX for m in margin)
        self._margin = (min(x, self._size[0]), min(y, self._size[1]))

    def _deliver(self, time_s: float, frame: int) -> Frame:
        begin, end = self._camera.span(time_s)
        count = self._pictures
        instants = [begin + (end - begin) * (k + 0.5) / count for k in range(count)]
        times = np.linspace(begin - 1e-4, end + 1e-4, self._poses)
        poses, bodies = self._motion(times)
        shots = [self._shot(t) for t in instants]
        wanted, nearest_m = needed(self._camera, (times, poses), shots[0][2], self._margin, instants[0] - time_s)
        if wanted[0] > self._margin[0] or wanted[1] > self._margin[1]:
            self._widen((max(wanted[0], self._margin[0]), max(wanted[1], self._margin[1])))
            shots = [self._shot(t) for t in instants]
        seen = {int(i) for shot in shots for i in np.unique(shot[3])} - {0}
        moving = {i: (times, bodies[i]) for i in sorted(seen & bodies.keys())[:_MAX_BODIES]}
        (when, rgb, depth, ids), *further = shots
        return self._camera.submit(
            rgb,
            depth=depth,
            ids=ids,
            bodies=moving,
            poses=(times, poses),
            axes="opengl",
            quaternion="wxyz",
            pictures=further,
            time=time_s,
            color_time=when,
            frame=frame,
            nearest_m=nearest_m,
            output=self._outputs,
        )

    def _motion(self, times: Array) -> tuple[Array, dict[int, Array]]:
        """World from camera at each time, (n, 4, 4), and position and quaternion (w first) of objects that move, by their number."""
        poses, places = [], []
        for time_s in times:
            self._go_to(float(time_s))
            place, turn, _ = self._scene.camera.matrix_world.decompose()
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = np.array(turn.to_matrix()), place
            poses.append(pose)
            things = [o.matrix_world.decompose() for o in self._scene.objects]
            places.append([[*p, *q] for p, q, _ in things])
        where = np.array(places, float)
        # The same turn has two quaternions: each follows the one before it.
        for i in range(1, len(where)):
            where[i, :, 3:] *= np.where((where[i, :, 3:] * where[i - 1, :, 3:]).sum(axis=1, keepdims=True) < 0, -1, 1)
        moves = np.ptp(where, axis=0).max(axis=1)
        return np.array(poses), {i + 1: where[:, i] for i in range(where.shape[1]) if moves[i] > 1e-7}

    def _shot(self, time_s: float) -> tuple[float, Array, Array, Array]:
        """Time, linear colour, depth in m and object numbers of an instant, with the margin."""
        self._go_to(time_s)
        scene, (x, y), (width, height) = self._scene, self._margin, self._size
        eye, fx = scene.camera.data, float(self._camera.matrix[0, 0])
        wide, high = width + 2 * x, height + 2 * y
        scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = wide, high, 100
        # The same pixels, and more of them. The shift is in widths.
        eye.sensor_fit, eye.sensor_width = "HORIZONTAL", eye.lens * wide / fx
        k = self._camera.matrix
        eye.shift_x, eye.shift_y = (width / 2 - k[0, 2]) / wide, (k[1, 2] - height / 2) / wide
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "MULTI_LAYER_IMAGE"
        settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"
        if hasattr(settings, "use_exr_interleave"):
            # All passes in one part.
            settings.use_exr_interleave = True
        with tempfile.TemporaryDirectory() as folder:
            scene.render.filepath = str(Path(folder) / "shot.exr")
            _bpy.ops.render.render(write_still=True, scene=scene.name)
            planes = read_exr(next(Path(folder).iterdir()))
        color = np.stack([_plane(planes, f"Combined.{c}") for c in "RGB"], axis=-1)
        depth = _plane(planes, "Depth.Z", "Depth.V")
        ids = np.rint(_plane(planes, "IndexOB.X", "Object Index.X", "Object Index.V")).astype(np.int32)
        # Where nothing is, Blender says 1e10 m.
        return time_s, color, np.where(depth < 1e9, depth, np.float32(np.inf)), ids


def _plane(planes: dict[str, Array], *endings: str) -> Array:
    for ending in endings:
        for name, plane in planes.items():
            if name.endswith(ending):
                return plane
    raise RuntimeError(f"Blender wrote {', '.join(planes)}: {endings[0]} is expected (Cycles writes it)")
