"""Runs the command line in a process of its own: what it does with signals, threads and memory stays there, and Ctrl-C leaves nothing
broken.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from .errors import ArgumentError, ProgramError

Progress = Callable[[str, int, int], None]

_STEP = re.compile(r"^(?P<what>.*) \((?P<step>\d+)/(?P<steps>\d+)(?P<left>.*)\)$")
_GRACE_S = 30.0
# Names the process without which the program has nothing to do: `__main__` reads it.
PARENT = "SHUTTERBUG_PARENT"


def arguments(options: Mapping[str, Any]) -> list[str]:
    """Give keyword arguments as those of the command line: ``time_limit_s=60`` is ``--time-limit-s 60``."""
    words: list[str] = []
    for name, value in options.items():
        flag = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            words.append(flag)
        elif isinstance(value, str | os.PathLike):
            words += [flag, os.fspath(value)]
        elif isinstance(value, Sequence):
            words += [flag, ",".join(map(str, value))]
        else:
            words += [flag, str(value)]
    return words


def _program() -> list[str]:
    if sys.executable and os.path.basename(sys.executable).startswith("python"):
        return [sys.executable, "-m", "shutterbug"]
    found = shutil.which("shutterbug")
    if found is None:
        raise ProgramError("neither Python's own program nor `shutterbug` was found: put the folder of scripts on PATH")
    return [found]


def _tell(line: str, progress: bool | Progress) -> None:
    step = _STEP.match(line)
    if callable(progress):
        if step:
            progress(step["what"], int(step["step"]), int(step["steps"]))
    elif progress:
        # A whole line each: a notebook, a terminal and a log all take it.
        print(line, file=sys.stderr, flush=True)


def _stop(process: subprocess.Popen[str]) -> None:
    """Ask the program to finish what is in flight, and end it if it does not."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def run(words: Sequence[str], progress: bool | Progress = False) -> str:
    """Run the command line and give what it wrote to its standard output.

    `progress`: True writes its lines to `sys.stderr`; a function is called with (what, step, steps). ProgramError: it failed, with its
    sentence; ArgumentError: it was asked for what it does not know. KeyboardInterrupt passes through once the program has ended.
    """
    # A notebook's kernel asks every program for colours: its sentences are read here, and go into exceptions.
    plain = {name: value for name, value in os.environ.items() if name not in ("CLICOLOR_FORCE", "FORCE_COLOR")}
    # Not in this process' group: Ctrl-C reaches it once, by `_stop`.
    process = subprocess.Popen(
        [*_program(), *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,
        env=plain | {"NO_COLOR": "1", PARENT: str(os.getpid())},
    )
    said: list[str] = []
    try:
        with process:
            assert process.stderr is not None and process.stdout is not None
            for line in process.stderr:
                said.append(line.rstrip("\n"))
                _tell(said[-1], progress)
            output = process.stdout.read()
    except BaseException:
        _stop(process)
        raise
    if process.returncode == 0:
        return output
    errors = [line for line in said if "error:" in line] or said or [f"exit code {process.returncode}"]
    sentence = errors[-1].split("error: ", 1)[-1]
    if process.returncode == 2:
        raise ArgumentError(sentence)
    raise ProgramError(sentence, process.returncode)
