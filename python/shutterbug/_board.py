"""A recording or photographs of a calibration board: the camera that took them, and a capture for `diagnose`."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ._arrays import Array, to_numpy
from ._run import Progress, arguments, run
from .camera import Camera
from .errors import ArgumentError

PathLike = str | os.PathLike[str]

_LENS = ("k1", "k2", "p1", "p2", "k3")
# Scan orders of lines read along rows and along columns: the first where the time that was fitted is above 0.
_ORDERS = {
    "readout_rows_s": ("top_to_bottom", "bottom_to_top"),
    "readout_columns_s": ("left_to_right", "right_to_left"),
}


class Board:
    """What `board` found: a camera, how well it fits, and a capture that `diagnose` takes. In a notebook it shows itself.

    `folder`: the capture. `report`: board.json as a dictionary.
    """

    def __init__(self, folder: PathLike) -> None:
        """Read `folder`, a capture that `board` wrote. OSError, ValueError: it holds no board.json."""
        self.folder = Path(folder)
        self.report: dict[str, Any] = json.loads((self.folder / "board.json").read_text("utf-8"))

    def _value(self, name: str) -> float:
        return float(self.report["camera"].get(name, {"value": 0.0})["value"])

    @property
    def matrix(self) -> Array:
        """The pinhole of the pictures at full size as a 3x3 matrix of float64, px; the top left pixel's centre is at (0.5, 0.5)."""
        fx, fy, cx, cy = map(self._value, ("fx", "fy", "cx", "cy"))
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], np.float64)

    @property
    def distortion(self) -> Array:
        """The lens as OpenCV orders it, (5) of float64: k1, k2, p1, p2, k3; without unit, 0 where a coefficient was not needed."""
        return np.array([self._value(name) for name in _LENS], np.float64)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the pictures, px."""
        width, height = self.report["size_px"]
        return int(width), int(height)

    @property
    def rms_px(self) -> float:
        """Reprojection error with lens and readout, root of the mean square, px."""
        return float(self.report["rms_px"]["with_lens_and_readout"])

    @property
    def pinhole_rms_px(self) -> float:
        """The same of the best camera without a lens and with a global shutter, px."""
        return float(self.report["rms_px"]["pinhole_alone"])

    @property
    def parameters(self) -> list[dict[str, Any]]:
        """What was fitted: rows of ``parameter``, ``value``, ``low``, ``high`` (bounds of 95 %). Lengths in px, times in s."""
        found = self.report["camera"].items()
        return [{"parameter": n, "value": p["value"], "low": p["ci95"][0], "high": p["ci95"][1]} for n, p in found]

    @property
    def views(self) -> list[dict[str, Any]]:
        """Pictures that show the board: rows of ``file``, ``points`` and ``rms_px``, the reprojection error in px."""
        return list(self.report["views"])

    @property
    def left_out(self) -> list[dict[str, str]]:
        """Pictures that were not used: rows of ``file`` and ``why``."""
        return list(self.report["left_out"])

    @property
    def camera(self) -> Camera:
        """The camera that was fitted, of the pictures' full size: pinhole, lens, and rolling shutter where frames followed each other.

        The capture's own camera.toml is the pinhole alone: what it lacks is what `diagnose` is to find. OSError: the folder is there no
        more.
        """
        pinhole = Camera.from_toml(self.folder / "camera.toml")
        effects: dict[str, dict[str, Any]] = {}
        if self.distortion.any():
            effects["lens_distortion"] = dict(zip(_LENS, map(float, self.distortion), strict=True))
        readout = max(_ORDERS, key=lambda name: abs(self._value(name)))
        if self._value(readout):
            order = _ORDERS[readout][self._value(readout) < 0]
            effects["rolling_shutter"] = {"readout_time_s": abs(self._value(readout)), "scan_order": order}
        k, (width, height) = self.matrix, self.size
        return Camera(
            width,
            height,
            fx=k[0, 0],
            fy=k[1, 1],
            cx=k[0, 2],
            cy=k[1, 2],
            frame_period_s=pinhole.frame_period_s,
            effects=effects,
        )

    def __repr__(self) -> str:
        seen, fit = len(self.views), f"{self.rms_px:.3f} px rms (pinhole alone {self.pinhole_rms_px:.3f})"
        return f"<shutterbug.Board {seen} of {seen + len(self.left_out)} pictures, {fit}>"

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><td>{r['parameter']}</td>" + _cells(r["value"], r["low"], r["high"]) + "</tr>" for r in self.parameters)
        head = "".join(f"<th>{n}</th>" for n in ("parameter", "value", "low", "high"))
        return f"<p>{repr(self)[1:-1]}</p><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _cells(*values: float) -> str:
    return "".join(f"<td>{value:.5g}</td>" for value in values)


def _table(corners: Mapping[str, Any], folder: str) -> Path:
    """Corners in memory as the file that the program reads."""
    lines = ["file,col,row,u_px,v_px"]
    for name, given in corners.items():
        seen = to_numpy(given, f"corners of {name}").astype(np.float64)
        if seen.ndim == 3 and seen.shape[2] == 2:
            row, col = np.mgrid[0 : seen.shape[0], 0 : seen.shape[1]]
            seen = np.column_stack([col.ravel(), row.ravel(), seen.reshape(-1, 2)])
            seen = seen[np.isfinite(seen).all(axis=1)]
        if seen.ndim != 2 or seen.shape[1] != 4:
            raise ArgumentError(f"corners of {name} have the shape {seen.shape}: (rows, columns, 2) or (n, 4) is expected")
        if not np.isfinite(seen).all() or (seen[:, :2] != np.round(seen[:, :2])).any():
            raise ArgumentError(f"corners of {name}: column and row are whole numbers, places are finite numbers in px")
        if "," in name or "\n" in name:
            raise ArgumentError(f"corners of {name!r}: a file's name without commas and line breaks is expected")
        lines += [f"{name},{int(c)},{int(r)},{u!r},{v!r}" for c, r, u, v in seen.tolist()]
    file = Path(folder) / "corners.csv"
    file.write_text("\n".join(lines) + "\n", "utf-8")
    return file


def board(
    frames: PathLike | Sequence[PathLike],
    out: PathLike,
    *,
    size: tuple[int, int] | None = None,
    square_m: float | None = None,
    pattern: str | None = None,
    target: PathLike | None = None,
    corners: PathLike | Mapping[str, Any] | None = None,
    fps: float | None = None,
    progress: bool | Progress = False,
    **options: Any,
) -> Board:
    """Find a calibration board in photographs or a recording, fit the camera that took them, and write a capture for `diagnose`.

    `frames`: a folder of PNG or JPEG, or the files. `out`: folder for the capture, board.json and corners.csv, made if absent.
    `size`: columns and rows, inner corners of a checkerboard (9, 6), squares of a ChArUco board. `square_m`: side of a square, m
    (None: 1, squares are the unit of length). `pattern`: ``"checkerboard"`` (None) or ``"charuco"``. `target`: Kalibr's target.yaml
    in place of the three. `corners`: those that another tool found, a file of lines ``file,col,row,u_px,v_px``, or ``{file name:
    array}`` with arrays of floats of the shape (rows, columns, 2), u and v in px and nan where nothing was seen, or (n, 4): col, row,
    u, v.
    `fps`: frames that follow each other, Hz; then a readout time is fitted too. `progress` and `options` (``marker_share``,
    ``dictionary``, ``shrink``, ``overwrite``) as of `simulate`: those of ``shutterbug board --help``.

    ProgramError: no board, or not enough views, with what was seen instead; ArgumentError: a size, pattern or option that cannot be.
    """
    files = [frames] if isinstance(frames, str | os.PathLike) else list(frames)
    if not files:
        raise ArgumentError("frames are none: a folder, or files, are expected")
    if size is not None and (len(size) != 2 or any(int(n) != n for n in size)):
        raise ArgumentError(f"size is {size!r}: columns and rows as in (9, 6) are expected")
    with tempfile.TemporaryDirectory() as folder:
        chosen = {
            "out": out,
            "size": None if size is None else f"{int(size[0])}x{int(size[1])}",
            "square_m": square_m,
            "pattern": pattern,
            "target": target,
            "corners": _table(corners, folder) if isinstance(corners, Mapping) else corners,
            "fps": fps,
        }
        run(["board", *(os.fspath(f) for f in files), *arguments(chosen | options)], progress)
    return Board(out)
