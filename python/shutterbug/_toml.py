"""Writes the small part of TOML that a camera.toml is made of: numbers, texts, flags, lists of numbers, one level of tables."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def _value(value: Any, name: str) -> str:
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, int | np.integer):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return repr(float(value))
    if isinstance(value, str):
        # JSON's escapes are all TOML's too.
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Sequence | np.ndarray):
        return "[" + ", ".join(_value(v, name) for v in value) + "]"
    raise TypeError(f"{name} is {type(value).__name__}: a number, a text, a flag or a list of numbers is expected")


def dumps(table: Mapping[str, Any]) -> str:
    """Give the text of a table whose values are plain or tables of plain values. TypeError names what is neither."""
    plain = {k: v for k, v in table.items() if not isinstance(v, Mapping)}
    lines = [f"{name} = {_value(value, name)}" for name, value in plain.items()]
    for name, inner in table.items():
        if isinstance(inner, Mapping):
            lines += ["", f"[{name}]"] + [f"{k} = {_value(v, f'{name}.{k}')}" for k, v in inner.items()]
    return "\n".join(lines) + "\n"
