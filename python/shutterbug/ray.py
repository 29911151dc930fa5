"""Ray: data sets of many captures on many machines, by Ray Data.

>>> rows = shutterbug.ray.simulate(captures, "/shared/dataset", actors=16, format="webdataset")

One capture is one piece of work of one actor. What an actor that was killed had begun is done by another. The same captures and seed give
the same bytes, whatever the number of actors, on one kind of device; a second call goes on where the first one was stopped.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ._shards import check_format
from .errors import ArgumentError
from .fleet import Task, join, make, tasks_of
from .folders import diagnose as _diagnose

# It states no types that checkers know.
_data: Any = importlib.import_module("ray.data")

__all__ = ["diagnose", "simulate"]


class _Simulator:
    """What an actor is: it keeps its processors for itself."""

    def __init__(self, out: str, format: str, cpus: float) -> None:
        # A software driver takes all processors that it sees otherwise.
        os.environ.setdefault("LP_NUM_THREADS", str(max(1, int(cpus))))
        self._out, self._format = out, format

    def __call__(self, row: dict[str, Any]) -> dict[str, Any]:
        done = make(Task(**row), self._out, self._format)
        return {"name": done["name"], "sha256": done["sha256"]}


class _Diagnoser:
    def __init__(self, out: str, options: dict[str, Any]) -> None:
        self._out, self._options = Path(out), options

    def __call__(self, row: dict[str, Any]) -> dict[str, Any]:
        # A run that was stopped left a journal there and goes on with it; one that is finished has its report.
        folder = self._out / row["name"]
        if not (folder / "report.json").exists():
            _diagnose(capture=row["capture"], out=folder, progress=False, **self._options)
        return {"name": row["name"]}


def _run(rows: list[dict[str, Any]], worker: type, arguments: tuple[Any, ...], actors: int, cpus: float, gpus: float) -> list[Any]:
    if actors < 1 or not rows:
        raise ArgumentError(f"actors is {actors}, captures {len(rows)}: one or more of each is expected")
    # A block each: what one actor takes is one capture.
    captures = _data.from_items(rows, override_num_blocks=len(rows))
    pool = _data.ActorPoolStrategy(size=actors)
    needs = {"num_cpus": cpus, "num_gpus": gpus or None}
    result: list[Any] = captures.map(worker, fn_constructor_args=arguments, compute=pool, **needs).take_all()
    return result


def simulate(
    captures: Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    *,
    actors: int = 1,
    cpus: float = 2,
    gpus: float = 0,
    format: str = "folder",
    camera: str | os.PathLike[str] | None = None,
    method: str | None = None,
    seed: int = 0,
) -> list[dict[str, Any]]:
    """Simulate captures into a data set, and give its manifest, which also lies in `out`/manifest.jsonl.

    `captures`: folders, told apart by their names. `out`: a folder that all machines see. `actors`: how many; `cpus`, `gpus`: what each
    takes of a machine (with a GPU 0.25 and the like; on processors 2 to 4 each). `format`: ``"folder"``, ``"webdataset"`` or
    ``"parquet"``. `camera`: a file, in place of the captures' own. `method` as of `shutterbug.simulate`. `seed`: of the data set; each
    capture's is drawn from it and its name. Rows as of `shutterbug.fleet.make`.

    ArgumentError: a number or a name; errors of Ray where an actor fails for good, with the capture's sentence in it.
    """
    check_format(format)
    tasks = tasks_of([Path(c).resolve() for c in captures], seed=seed, camera=camera and Path(camera).resolve(), method=method)
    to = Path(out).resolve()
    to.mkdir(parents=True, exist_ok=True)
    _run([asdict(t) for t in tasks], _Simulator, (os.fspath(to), format, cpus), actors, cpus, gpus)
    return join(to, [t.name for t in tasks])


def diagnose(
    captures: Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    *,
    actors: int = 1,
    cpus: float = 2,
    gpus: float = 0,
    **options: Any,
) -> dict[str, Path]:
    """Diagnose captures, each into a folder of `out` by its name, and give those folders: `shutterbug.Diagnosis(folder)` reads one.

    `options` as of `shutterbug.diagnose`; all else as of `simulate`. Reports that are there already are kept.
    Errors as of `simulate`.
    """
    tasks = tasks_of([Path(c).resolve() for c in captures])
    to = Path(out).resolve()
    to.mkdir(parents=True, exist_ok=True)
    rows = [{"name": t.name, "capture": t.capture} for t in tasks]
    _run(rows, _Diagnoser, (os.fspath(to), options), actors, cpus, gpus)
    return {t.name: to / t.name for t in tasks}
