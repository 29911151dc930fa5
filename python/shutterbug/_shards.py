"""A capture's pictures as one file: a shard of WebDataset, or Parquet. The same frames give the same bytes."""

from __future__ import annotations

import importlib
import io
import json
import tarfile
from pathlib import Path
from typing import Any

from .errors import ArgumentError, InputError

FORMATS = ("folder", "webdataset", "parquet")
SUFFIXES = {"folder": "", "webdataset": ".tar", "parquet": ".parquet"}
# Columns of Parquet in the order of instants.csv, behind the frame's number.
_TIMES = ("first_line_start_ns", "middle_ns", "last_line_end_ns")
_POSE = ("tx_m", "ty_m", "tz_m", "qx", "qy", "qz", "qw")


def check_format(name: str) -> None:
    """ArgumentError: no such format, or what it needs is not installed."""
    if name not in FORMATS:
        raise ArgumentError(f"format is {name!r}: one of {', '.join(FORMATS)} is expected")
    if name == "parquet":
        _pyarrow()


def pictures_of(folder: Path) -> list[Path]:
    """Give the pictures of a simulated capture in order."""
    return sorted(p for p in folder.iterdir() if p.suffix == ".png")


def pack(folder: Path, name: str, to: Path, format: str) -> Path:
    """Write the frames of `folder`, capture `name`, as one file, and give it."""
    return _tar(folder, name, to) if format == "webdataset" else _parquet(folder, name, to)


def _instants(folder: Path) -> tuple[list[str], dict[str, list[str]]]:
    lines = [line.split(",") for line in (folder / "instants.csv").read_text("utf-8").splitlines()]
    titles = [lines[0][0].lstrip("#"), *lines[0][1:]]
    return titles, dict(zip((p.stem for p in pictures_of(folder)), lines[1:], strict=True))


def _tar(folder: Path, name: str, to: Path) -> Path:
    """Samples of NAME/NNNNNN.png and NAME/NNNNNN.json (times and pose)."""
    titles, told = _instants(folder)
    with tarfile.open(to, "w", format=tarfile.USTAR_FORMAT) as tar:
        for picture in pictures_of(folder):
            instants = dict(zip(titles, told[picture.stem], strict=True))
            about = json.dumps({"capture": name, "frame": int(picture.stem), "instants": instants}, sort_keys=True).encode()
            for suffix, content in (("png", picture.read_bytes()), ("json", about)):
                entry = tarfile.TarInfo(f"{name}/{picture.stem}.{suffix}")
                entry.size = len(content)
                tar.addfile(entry, io.BytesIO(content))
    return to


def _pyarrow() -> Any:
    try:
        return importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise ArgumentError(f"format is 'parquet': {error}: pip install pyarrow") from None


def _parquet(folder: Path, name: str, to: Path) -> Path:
    """One row a frame: capture, frame, image (struct of bytes and path, as Hugging Face's `datasets` reads it), times, pose."""
    arrow, parquet = _pyarrow()
    titles, told = _instants(folder)
    if len(titles) != 1 + len(_TIMES) + len(_POSE):
        raise InputError(f"{folder}/instants.csv has {len(titles)} columns: {1 + len(_TIMES) + len(_POSE)} are expected")
    pictures = pictures_of(folder)
    image = arrow.struct([("bytes", arrow.binary()), ("path", arrow.string())])
    columns: dict[str, Any] = {
        "capture": arrow.array([name] * len(pictures), arrow.string()),
        "frame": arrow.array([int(p.stem) for p in pictures], arrow.int32()),
        "image": arrow.array([{"bytes": p.read_bytes(), "path": f"{name}/{p.name}"} for p in pictures], image),
    }
    for place, column in enumerate((*_TIMES, *_POSE), 1):
        kind, number = (arrow.int64(), int) if column in _TIMES else (arrow.float64(), float)
        columns[column] = arrow.array([number(told[p.stem][place]) for p in pictures], kind)
    # PNG is compressed.
    parquet.write_table(arrow.table(columns), to, compression="none", row_group_size=256)
    return to
