"""Many captures on many machines: shards, manifests, resuming. Of the standard library alone; `shutterbug.ray` stands on it.

    shutterbug simulate captures.txt --out DIR --shard 3/16 --resume

One capture is one piece of work: automatic exposure goes from frame to frame. The seed of each is drawn from the data set's seed and the
capture's name, never from who does it or in which order, so any number of workers writes the same bytes on one kind of device.
"""

from __future__ import annotations

import argparse
import glob
import hashlib
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from . import _core
from ._shards import FORMATS, SUFFIXES, check_format, pack, pictures_of
from .errors import ArgumentError, ShutterbugError
from .folders import simulate

__all__ = ["Task", "join", "main", "make", "read_list", "tasks_of"]


@dataclass(frozen=True)
class Task:
    """One capture to be simulated. `name`: of its shard, unique in the data set. `capture`: its folder. `seed`: of its noise, below
    2**48. `camera`: a file, or None: its own. `method`: as of `shutterbug.simulate`, or None.
    """

    name: str
    capture: str
    seed: int
    camera: str | None = None
    method: str | None = None


def seed_of(seed: int, name: str) -> int:
    """Give the seed of a capture from that of the data set and the capture's name."""
    return int.from_bytes(hashlib.sha256(f"{seed}/{name}".encode()).digest()[:6], "little")


def tasks_of(
    captures: Sequence[str | os.PathLike[str]], *, seed: int = 0, camera: str | os.PathLike[str] | None = None, method: str | None = None
) -> list[Task]:
    """Give the work of a data set in the order of its names: those of the folders `captures`.

    `seed`: of the data set, a whole number; each capture's is drawn from it and its name. `camera`, `method`: of every capture, as of
    `Task`. ArgumentError: two have one name.
    """
    found: dict[str, Task] = {}
    for capture in map(Path, captures):
        name = capture.resolve().name
        if name in found:
            raise ArgumentError(f"{capture} and {found[name].capture} have the same name: a data set's captures are told apart by it")
        chosen = None if camera is None else os.fspath(camera)
        found[name] = Task(name, os.fspath(capture), seed_of(seed, name), chosen, method)
    return [found[name] for name in sorted(found)]


def read_list(file: str | os.PathLike[str]) -> list[Path]:
    """Read `file`, a list of captures: a folder a line, beside the list unless absolute; empty lines and those that begin with # mean
    nothing. OSError: it cannot be read.
    """
    lines = [line.strip() for line in Path(file).read_text("utf-8").splitlines()]
    return [Path(file).parent / line for line in lines if line and not line.startswith("#")]


def make(task: Task, out: str | os.PathLike[str], format: str = "folder") -> dict[str, Any]:
    """Simulate the capture of `task` into its shard, unless that is there already, and give its row of the manifest.

    `out`: folder of the data set. `format`: ``"folder"`` (`out`/name/), ``"webdataset"`` (`out`/name.tar, one sample a frame) or
    ``"parquet"`` (`out`/name.parquet, one row a frame: capture, frame, image, times in ns, pose in m; needs pyarrow). A shard has another
    name until it is whole. The row: ``name``, ``capture``, ``shard``, ``frames``, ``sha256`` (of all pictures, whatever the format),
    ``shard_sha256`` (of the file), ``camera_sha256``, ``inputs_sha256``, ``device``, ``driver``, ``seed``, ``method``, ``shutterbug``.

    ArgumentError: no such format, or pyarrow is missing; errors of `shutterbug.simulate`.
    """
    check_format(format)
    out = Path(out)
    rows = out / "rows"
    rows.mkdir(parents=True, exist_ok=True)
    row_file = rows / f"{task.name}.json"
    asked = {**asdict(task), "format": format, "shutterbug": _core.VERSION}
    shard = out / f"{task.name}{SUFFIXES[format]}"
    if row_file.exists() and shard.exists():
        row: dict[str, Any] = json.loads(row_file.read_text("utf-8"))
        if row.pop("asked", None) == asked:
            return row
    with tempfile.TemporaryDirectory(prefix=f".{task.name}.", dir=out) as folder:
        part = Path(folder) / "frames"
        simulate(task.capture, part, camera=task.camera, method=task.method, seed=task.seed)
        row = _row(task, part) | {"shard": shard.name}
        if format != "folder":
            part = pack(part, task.name, Path(folder) / "shard", format)
            row["shard_sha256"] = hashlib.sha256(part.read_bytes()).hexdigest()
        _put(part, shard)
    _write(row_file, json.dumps(row | {"asked": asked}, indent=1, sort_keys=True))
    return row


def _row(task: Task, folder: Path) -> dict[str, Any]:
    pictures, digest = pictures_of(folder), hashlib.sha256()
    for picture in pictures:
        digest.update(picture.name.encode() + b"\0" + hashlib.sha256(picture.read_bytes()).digest())
    told = json.loads((folder / "simulate.json").read_text("utf-8"))
    camera = Path(task.camera) if task.camera else Path(task.capture) / "camera.toml"
    names = {Path(name).name: sha for name, sha in told["files_sha256"].items()}
    device = next((d for d in _device() if d["chosen"]), {"name": "", "driver": ""})
    return {
        "name": task.name,
        "capture": Path(task.capture).name,
        "frames": len(pictures),
        "sha256": digest.hexdigest(),
        "camera_sha256": hashlib.sha256(camera.read_bytes()).hexdigest(),
        "inputs_sha256": hashlib.sha256(json.dumps(names, sort_keys=True).encode()).hexdigest(),
        "device": device["name"],
        "driver": device["driver"],
        "seed": task.seed,
        "method": told["method"],
        "shutterbug": told["shutterbug"],
    }


_devices: list[dict[str, Any]] = []


def _device() -> list[dict[str, Any]]:
    # Asked once a process: it takes as long as a small frame.
    if not _devices:
        from ._device import devices

        _devices.extend(devices())
    return _devices


def _put(part: Path, shard: Path) -> None:
    """Give a shard its name at once. One that lies there from another run is taken away first."""
    if shard.is_dir():
        shutil.rmtree(shard)
    os.replace(part, shard)


def _write(file: Path, text: str) -> None:
    part = file.with_name(f".{file.name}.{os.getpid()}")
    part.write_text(text + "\n", "utf-8")
    os.replace(part, file)


def join(out: str | os.PathLike[str], names: Iterable[str]) -> list[dict[str, Any]]:
    """Write `out`/manifest.jsonl from the rows of finished shards, in the order of `names`, sorted, and give it. KeyError: one is missing.

    What workers that were killed have left behind is removed: by then every shard is there.
    """
    found = []
    for name in sorted(names):
        file = Path(out) / "rows" / f"{name}.json"
        if not file.exists():
            raise KeyError(f"{name}: its shard is not finished")
        row = json.loads(file.read_text("utf-8"))
        row.pop("asked", None)
        found.append(row)
    for row in found:
        for left in Path(out).glob(f".{glob.escape(row['name'])}.*"):
            shutil.rmtree(left, ignore_errors=True)
    _write(Path(out) / "manifest.jsonl", "\n".join(json.dumps(row, sort_keys=True) for row in found))
    return found


def _share(text: str) -> tuple[int, int]:
    number, _, count = text.partition("/")
    if not (number.isdigit() and count.isdigit() and 0 <= int(number) < int(count)):
        raise argparse.ArgumentTypeError(f"{text}: I/N with 0 <= I < N is expected")
    return int(number), int(count)


def main(words: list[str] | None = None) -> int:
    """Run ``shutterbug simulate LIST`` with `words` (None: the process' own); exit codes as of all commands: 0 done, 1 input or machine at
    fault (with a sentence on stderr). SystemExit with the code 2: usage.
    """
    parser = argparse.ArgumentParser("shutterbug simulate", description="Simulates the captures of a list, or a share of them.")
    parser.add_argument("list", help="a file with a capture's folder a line")
    parser.add_argument("--out", required=True, help="folder of the data set")
    parser.add_argument("--shard", type=_share, default=(0, 1), metavar="I/N", help="every N-th capture from number I on; 0 <= I < N")
    parser.add_argument("--resume", action="store_true", help="keep shards that are finished; without it they must not be there")
    parser.add_argument("--format", choices=FORMATS, default="folder")
    parser.add_argument("--camera", help="another camera than the captures' own")
    parser.add_argument("--method")
    parser.add_argument("--seed", type=int, default=0, help="of the data set")
    a = parser.parse_args(words)
    try:
        tasks = tasks_of(read_list(a.list), seed=a.seed, camera=a.camera, method=a.method)
        mine = tasks[a.shard[0] :: a.shard[1]]
        there = [t.name for t in mine if (Path(a.out) / "rows" / f"{t.name}.json").exists()]
        if there and not a.resume:
            raise ArgumentError(f"{there[0]} is finished already: --resume keeps what is there")
        for number, task in enumerate(mine, 1):
            row = make(task, a.out, a.format)
            print(f"{row['name']} {row['sha256'][:16]} ({number}/{len(mine)})", file=sys.stderr, flush=True)
        if all((Path(a.out) / "rows" / f"{t.name}.json").exists() for t in tasks):
            join(a.out, [t.name for t in tasks])
    except (ShutterbugError, OSError) as error:
        print(f"shutterbug: error: {error}", file=sys.stderr)
        return 1
    return 0
