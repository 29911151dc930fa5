"""The program `shutterbug`, as `pip` installs it: the same command line as the Rust program's."""

from __future__ import annotations

import os
import signal
import sys

from . import _core
from ._device import bundled_driver
from ._run import PARENT
from .errors import NoDeviceError

_VARIABLE = "SHUTTERBUG_VULKAN_LIBRARY"


def _take_bundled_driver_where_nothing_else_is() -> None:
    driver = bundled_driver()
    if driver is None or os.environ.get(_VARIABLE):
        return
    try:
        if _core.devices():
            return
    except NoDeviceError:
        pass
    os.environ[_VARIABLE] = driver


def _end_with_parent() -> None:
    """A worker that is killed at once (out of memory, preempted) cannot end the run that it began: the kernel tells that."""
    parent = os.environ.pop(PARENT, None)
    if parent is None or not sys.platform.startswith("linux"):
        return
    import ctypes

    pr_set_pdeathsig = 1
    ctypes.CDLL(None).prctl(pr_set_pdeathsig, int(signal.SIGTERM))
    if str(os.getppid()) != parent:
        sys.exit(1)


def main() -> int:
    """Run the command line of this process and give its exit code: 0 done, 1 input or machine at fault, 2 usage."""
    _end_with_parent()
    if sys.argv[1:2] == ["bag"]:
        # Of the package alone: it stands on readers that are written in Python.
        try:
            from . import bag
        except ImportError as error:
            print(f"shutterbug: error: {error}: pip install shutterbug[bag]", file=sys.stderr)
            return 1
        return bag.main(sys.argv[2:])
    if sys.argv[1:2] == ["simulate"] and any(os.path.isfile(word) for word in sys.argv[2:3]):
        # A capture is a folder: a file is a list of them.
        from . import fleet

        return fleet.main(sys.argv[2:])
    _take_bundled_driver_where_nothing_else_is()
    return _core.run_command_line(["shutterbug", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
