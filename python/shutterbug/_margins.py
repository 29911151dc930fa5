"""How wide a margin a frame needs: what lens and motion bring in from beyond the picture."""

from __future__ import annotations

import numpy as np

from ._arrays import Array
from .camera import Camera


def needed(
    camera: Camera, poses: tuple[Array, Array], depth: Array, margin: tuple[int, int], delay_s: float
) -> tuple[tuple[int, int], float]:
    """Give the columns and rows that a frame needs beyond each side, px, and the nearest depth at its border, m (0: unknown).

    `poses`: times, s, and world from camera, (n, 4, 4). `depth`: m, with its margin. `delay_s`: when it was rendered, after the frame's
    start.
    """
    times, matrices = poses
    steps = np.diff(times)
    speed = float((np.linalg.norm(np.diff(matrices[:, :3, 3], axis=0), axis=1) / steps).max())
    between = np.einsum("nij,nik->njk", matrices[:-1, :3, :3], matrices[1:, :3, :3])
    cosine = np.clip((np.trace(between, axis1=1, axis2=2) - 1) / 2, -1, 1)
    turn = float((np.arccos(cosine) / steps).max())
    nearest_m = 0.0
    if speed > 0:
        x, y = (max(1, m) for m in margin)
        border = np.concatenate([depth[:y].ravel(), depth[-y:].ravel(), depth[:, :x].ravel(), depth[:, -x:].ravel()])
        nearest_m = float(border.min()) if np.isfinite(border.min()) else 0.0
    # A little more than the bound, which is of what lies between states.
    wide, high = camera.margin(1.1 * turn + 1e-6, 1.1 * speed, nearest_m, delay_s)
    return (min(wide, camera.width), min(high, camera.height)), nearest_m
