"""Captures and folders of frames: simulate, diagnose, calibrate. What the program `shutterbug` does, from Python."""

from __future__ import annotations

import html
import json
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from . import _core
from ._run import Progress, arguments, run
from .camera import Camera
from .errors import ArgumentError

PathLike = str | os.PathLike[str]


def presets() -> dict[str, str]:
    """Give the names of the cameras that ship in the package, each with a line about it."""
    return dict(_core.presets())


def _camera_file(camera: Camera | PathLike | None, folder: str) -> PathLike | None:
    if isinstance(camera, Camera):
        file = Path(folder) / "camera.toml"
        camera.save(file)
        return file
    return camera


def simulate(
    capture: PathLike,
    out: PathLike,
    *,
    camera: Camera | PathLike | None = None,
    preset: str | None = None,
    method: str | None = None,
    seed: int | None = None,
    progress: bool | Progress = False,
    **options: Any,
) -> list[Path]:
    """Render every frame of a capture as its camera would have delivered it, and give the pictures' files in order.

    `capture`: a folder with camera.toml, scene.obj, trajectory.tum, frames.csv. `out`: folder of the pictures, made if absent.
    `camera`: another camera. `preset`: a camera of `presets()` whose effects are added. `method`: ``"exact"``, ``"fast"``,
    ``"accumulation"`` or ``"paper"``. `seed`: of all noise; same seed, same bits. `progress`: True for lines on stderr, or a function of
    (what, step, steps). `options`: further options of ``shutterbug simulate --help``, such as ``resume=True`` or ``batch=2``.

    ProgramError: a file or the machine is at fault; its sentence names file and line. ArgumentError: an option that is not there.
    """
    with tempfile.TemporaryDirectory() as folder:
        chosen = {
            "out": out,
            "camera": _camera_file(camera, folder),
            "preset": preset,
            "method": method,
            "seed": seed,
        }
        run(["simulate", os.fspath(capture), *arguments(chosen | options)], progress)
    return sorted(p for p in Path(out).iterdir() if p.suffix == ".png" and p.stem.isdigit())


class Diagnosis:
    """What `diagnose` found. In a notebook it shows itself. `folder`: where it lies. `report`: report.json as a dictionary."""

    def __init__(self, folder: PathLike, capture: PathLike | None = None, keep: Any = None) -> None:
        """Read `folder`, which `diagnose` wrote. `capture`: what was diagnosed, for `simulate`. `keep`: held as long as this.

        OSError, ValueError: it holds no report.
        """
        self.folder = Path(folder)
        self._capture, self._keep = capture, keep
        self.report: dict[str, Any] = json.loads((self.folder / "report.json").read_text("utf-8"))

    @property
    def verdict(self) -> str:
        """``"no_gap"``, ``"explained"``, ``"partly_explained"``, ``"unknown_effect"`` or ``"undetermined"``."""
        return str(self.report["verdict"])

    @property
    def gap(self) -> dict[str, Any]:
        """The gap before and after, its floor and the share that was closed, with their unit; of frames that no fit has seen."""
        return dict(self.report["gap"])

    @property
    def effects(self) -> list[dict[str, Any]]:
        """What explains the gap, largest share first: one row a parameter.

        Each row: ``effect``, ``share`` (of the gap), ``parameter``, ``value``, ``low``, ``high`` (bounds of 95 %, None without).
        ``pandas.DataFrame(diagnosis.effects)`` is a table.
        """
        rows = []
        for effect in self.report["effects"]:
            for name, found in effect.get("parameters", {}).items() or [("", {})]:
                low, high = found.get("ci95") or (None, None)
                row = {"effect": effect["name"], "share": effect.get("share"), "parameter": name}
                rows.append({**row, "value": found.get("value"), "low": low, "high": high})
        return rows

    @property
    def camera(self) -> Camera:
        """The camera that was given with the effects found. OSError: the folder is there no more."""
        return Camera.from_toml(self.folder / "camera.toml")

    @property
    def page(self) -> Path:
        """The page with figures, report.html."""
        return self.folder / "report.html"

    def simulate(self, out: PathLike, capture: PathLike | None = None, **options: Any) -> list[Path]:
        """Render `capture` (None: the one that was diagnosed) with the camera found into `out`; `options` and errors as of
        `shutterbug.simulate`. ArgumentError: there is no capture, because two folders of frames were diagnosed.
        """
        capture = capture or self._capture
        if capture is None:
            raise ArgumentError("which capture? two folders of frames were diagnosed, and hold no scene")
        return simulate(capture, out, camera=self.folder / "camera.toml", **options)

    def __repr__(self) -> str:
        names = ", ".join(e["name"] for e in self.report["effects"]) or "no effect"
        gap = self.gap
        change = f"{gap['before']:.3g} to {gap['after']:.3g} {gap.get('unit', '')}".rstrip()
        return f"<shutterbug.Diagnosis {self.verdict}: {names}; gap {change}>"

    def _repr_html_(self) -> str:
        def cell(value: Any) -> str:
            return html.escape(f"{value:.4g}" if isinstance(value, float) else "" if value is None else str(value))

        names = ["effect", "share", "parameter", "value", "low", "high"]
        head = "".join(f"<th>{n}</th>" for n in names)
        rows = "".join("<tr>" + "".join(f"<td>{cell(r[n])}</td>" for n in names) + "</tr>" for r in self.effects)
        said = html.escape(repr(self)[1:-1])
        return f"<p>{said}</p><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def diagnose(
    *,
    capture: PathLike | None = None,
    real: PathLike | None = None,
    sim: PathLike | None = None,
    unpaired: bool = False,
    out: PathLike | None = None,
    camera: Camera | PathLike | None = None,
    without: Sequence[str] = (),
    time_limit_s: float | None = None,
    progress: bool | Progress = True,
    **options: Any,
) -> Diagnosis:
    """Say which effects explain the gap between real frames and a simulation.

    `capture`: a folder with camera.toml, scene.obj, trajectory.tum, frames.csv and real/; or `real` and `sim`: two folders of frames
    of equal names, sizes and moments, or `unpaired` ones of other moments, of which less can be told. `out`: folder of report.json,
    report.html and camera.toml; None: one that lives as long as the result. `camera`: another camera than the capture's. `without`:
    effects to leave out. `time_limit_s`: s. `progress` as of `simulate`. `options`: further ones of ``shutterbug diagnose --help``.

    Ctrl-C: what was worked out is kept in `out`, and another run with the same `out` goes on from there. Errors as of `simulate`.
    """
    if (capture is None) == (real is None or sim is None):
        raise ArgumentError("either capture, or real and sim are expected")
    keep = None if out is not None else tempfile.TemporaryDirectory(prefix="shutterbug-")
    to: PathLike = out if keep is None else keep.name  # type: ignore[assignment]
    limit = None if time_limit_s is None else max(1, round(time_limit_s))
    with tempfile.TemporaryDirectory() as folder:
        chosen = {
            "out": to,
            "camera": _camera_file(camera, folder),
            "without": without or None,
            "time_limit_s": limit,
        }
        place = [os.fspath(capture)] if capture is not None else arguments({"real": real, "sim": sim, "unpaired": unpaired})
        run(["diagnose", *place, *arguments(chosen | options)], progress)
    return Diagnosis(to, capture, keep)


def calibrate(
    frames: Sequence[PathLike],
    out: PathLike,
    *,
    camera: Camera | PathLike | None = None,
    encoding: str = "srgb",
    progress: bool | Progress = False,
    **options: Any,
) -> dict[str, Any]:
    """Measure a camera's noise from two or more frames of one static scene, and give the report.

    `frames`: PNG of 8 or 16 bits, or JPEG. `out`: folder for camera.toml, report.json and figures, made if absent. `camera`: the camera
    that the noise is added to. `encoding`: ``"srgb"``, or ``"linear"`` of raw values. `progress` as of `simulate`. `options`: further ones
    of ``shutterbug calibrate noise --help``. Errors as of `simulate`.
    """
    with tempfile.TemporaryDirectory() as folder:
        chosen = {"out": out, "camera": _camera_file(camera, folder), "encoding": encoding}
        words = [os.fspath(f) for f in frames]
        run(["calibrate", "noise", *words, *arguments(chosen | options)], progress)
    report: dict[str, Any] = json.loads((Path(out) / "report.json").read_text("utf-8"))
    return report
