"""A tree of coordinate frames over time, as ROS's tf has it."""

from __future__ import annotations

from bisect import bisect_right
from typing import Any

import numpy as np

from ._arrays import Array
from .errors import ArgumentError, TimeRangeError


def _matrix(position: Any, turn: Any) -> Array:
    x, y, z, w = np.asarray(turn, float) / np.linalg.norm(turn)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = position
    return matrix


class Tree:
    """Which frame hangs on which, and how over time. Between two stamps: linear position, rotation on the shorter arc."""

    def __init__(self) -> None:
        """Begin without any."""
        self._parent: dict[str, str] = {}
        self._moving: dict[str, list[tuple[float, Array, Array]]] = {}
        self._fixed: dict[str, Array] = {}

    def add(self, parent: str, child: str, time_s: float, position: Any, turn: Any, fixed: bool) -> None:
        """Hang a frame on another: position in m, quaternion x y z w. ArgumentError: a quaternion of length 0."""
        if not np.linalg.norm(turn) > 1e-6:
            raise ArgumentError(f"tf from {parent} to {child} at {time_s} s: the quaternion has no length")
        self._parent[child] = parent
        if fixed:
            self._fixed[child] = _matrix(position, turn)
        else:
            self._moving.setdefault(child, []).append((time_s, np.asarray(position, float), np.asarray(turn, float)))

    def finish(self) -> None:
        """Sort what was added."""
        for stamps in self._moving.values():
            stamps.sort(key=lambda s: s[0])

    def chain(self, frame: str) -> list[str]:
        """The frame and all that it hangs on, without the root. ArgumentError: they hang on each other in a ring."""
        found: list[str] = []
        while frame in self._parent:
            if frame in found:
                raise ArgumentError(f"tf: {frame} hangs on itself")
            found.append(frame)
            frame = self._parent[frame]
        return found

    def root(self, frame: str) -> str:
        """What the frame hangs on at last."""
        chain = self.chain(frame)
        return self._parent[chain[-1]] if chain else frame

    def stamps(self, frame: str, begin_s: float, end_s: float) -> list[float]:
        """Times at which anything between the frame and its root is known, over a span and one beyond on each side. TimeRangeError: the
        span is not covered. With no moving link: the span's ends.
        """
        times: set[float] = set()
        for link in self.chain(frame):
            if link in self._fixed:
                continue
            own = [s[0] for s in self._moving[link]]
            first, last = bisect_right(own, begin_s) - 1, bisect_right(own, end_s)
            if first < 0 or (last == len(own) and own[-1] < end_s):
                own_span, span = f"{own[0]:.4f} s to {own[-1]:.4f} s", f"{begin_s:.4f} s to {end_s:.4f} s"
                raise TimeRangeError(f"tf of {link} reaches from {own_span}, {span} is needed")
            times.update(own[first : last + 1])
        inner = sorted(t for t in times if begin_s < t < end_s)
        return [begin_s, *inner, end_s]

    def pose(self, frame: str, time_s: float) -> Array:
        """Root from frame, 4x4."""
        pose = np.eye(4)
        for link in self.chain(frame):
            pose = (self._fixed[link] if link in self._fixed else self._between(self._moving[link], time_s)) @ pose
        return pose

    @staticmethod
    def _between(stamps: list[tuple[float, Array, Array]], time_s: float) -> Array:
        i = min(max(bisect_right(stamps, time_s, key=lambda s: s[0]), 1), len(stamps) - 1)
        if len(stamps) == 1:
            return _matrix(stamps[0][1], stamps[0][2])
        (begin, p, q), (end, r, s) = stamps[i - 1], stamps[i]
        share = min(max((time_s - begin) / (end - begin), 0.0), 1.0) if end > begin else 0.0
        q, s = q / np.linalg.norm(q), s / np.linalg.norm(s)
        cosine = float(q @ s)
        s = -s if cosine < 0 else s
        angle = np.arccos(min(abs(cosine), 1.0))
        if angle < 1e-6:
            turn = (1 - share) * q + share * s
        else:
            turn = (np.sin((1 - share) * angle) * q + np.sin(share * angle) * s) / np.sin(angle)
        return _matrix((1 - share) * p + share * r, turn)
