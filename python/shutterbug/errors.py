"""Exceptions: one a status of the library, each with the library's own sentence.

All are a `ShutterbugError`, and beside it what Python's users would catch: `ValueError` where an argument is wrong, `OSError` where
a file is, `TimeoutError`, `MemoryError`.
"""

from __future__ import annotations

from . import _core

__all__ = [
    "ArgumentError",
    "DeviceLostError",
    "FileError",
    "ForkedError",
    "FormatError",
    "FullError",
    "HandleError",
    "InputError",
    "InternalError",
    "LimitError",
    "MissingMotionError",
    "NoDeviceError",
    "OutOfMemoryError",
    "ProgramError",
    "ShutterbugError",
    "StateError",
    "TimeRangeError",
    "TooSmallError",
    "UnsupportedError",
    "VulkanError",
    "WaitTimeoutError",
]


class ShutterbugError(Exception):
    """Any failure of the library. `status` is the name of its status, such as ``"INPUT"``; its text is the library's sentence."""

    status: str = "VULKAN"


class ArgumentError(ShutterbugError, ValueError):
    """An argument is out of range, not a number, or of a shape that cannot be."""

    status = "ARGUMENT"


class HandleError(ShutterbugError, RuntimeError):
    """What was used is closed."""

    status = "HANDLE"


class InternalError(ShutterbugError, RuntimeError):
    """A bug in the library. What was used cannot be used any more; all else can."""

    status = "PANIC"


class TooSmallError(ShutterbugError, ValueError):
    """The margin around the picture is too small for the lens and the motion; the sentence says how large it has to be."""

    status = "TOO_SMALL"


class FormatError(ShutterbugError, ValueError):
    """A picture's format is not possible here."""

    status = "FORMAT"


class StateError(ShutterbugError, RuntimeError):
    """The call needs another one first, or frames are in flight that forbid it."""

    status = "STATE"


class InputError(ShutterbugError, ValueError):
    """A file or a text holds something that cannot be used; the sentence names the line, what was found and what was expected."""

    status = "INPUT"


class FileError(ShutterbugError, OSError):
    """The operating system refused a file operation."""

    status = "IO"


class TimeRangeError(ShutterbugError, ValueError):
    """The poses do not reach over the frame; the sentence names the missing span. Nothing is extrapolated."""

    status = "TIME"


class FullError(ShutterbugError, RuntimeError):
    """All frames in flight are taken: ask one of them for its result first."""

    status = "FULL"


class WaitTimeoutError(ShutterbugError, TimeoutError):
    """The time limit passed. The frame can be waited for again."""

    status = "TIMEOUT"


class NoDeviceError(ShutterbugError, RuntimeError):
    """There is no Vulkan loader or driver, or no device that can be used: ``pip install shutterbug-driver`` brings one."""

    status = "NO_DEVICE"


class UnsupportedError(ShutterbugError, NotImplementedError):
    """The device, or this version of the library, cannot do it."""

    status = "UNSUPPORTED"


class DeviceLostError(ShutterbugError, RuntimeError):
    """The device was lost. A camera that is used again opens it anew."""

    status = "DEVICE_LOST"


class OutOfMemoryError(ShutterbugError, MemoryError):
    """The device or the host has no memory left. Nothing was changed."""

    status = "OUT_OF_MEMORY"


class LimitError(ShutterbugError, ValueError):
    """A size is beyond what the device or the options allow."""

    status = "LIMIT"


class VulkanError(ShutterbugError, RuntimeError):
    """Another Vulkan call failed."""

    status = "VULKAN"


class ForkedError(ShutterbugError, RuntimeError):
    """A frame belongs to the process that forked this one. Cameras open a device of their own in a forked process."""

    status = "FORKED"


class MissingMotionError(ShutterbugError, ValueError):
    """The camera has a shutter or blur, and nothing says how the picture moves: give depth and poses, or motion, or ``still=True``."""

    status = "ARGUMENT"


class ProgramError(ShutterbugError, RuntimeError):
    """A run of the program failed; its text is the last line that it wrote. `code` is its exit code."""

    status = "INPUT"

    def __init__(self, sentence: str, code: int = 1) -> None:
        """Keep `sentence` and `code`, the exit code: 1 input or machine at fault, 2 usage."""
        super().__init__(sentence)
        self.code = code


_OF_NAME: dict[str, type[ShutterbugError]] = {
    "POISONED": InternalError,
    "STRUCT_SIZE": InternalError,
    **{
        kind.status: kind
        for kind in (
            ArgumentError,
            HandleError,
            InternalError,
            TooSmallError,
            FormatError,
            StateError,
            InputError,
            FileError,
            TimeRangeError,
            FullError,
            WaitTimeoutError,
            NoDeviceError,
            UnsupportedError,
            DeviceLostError,
            OutOfMemoryError,
            LimitError,
            VulkanError,
            ForkedError,
        )
    },
    "NOT_READY": StateError,
    "BUSY": StateError,
}
_STATUSES = _core.statuses()


def of_status(status: int, sentence: str) -> ShutterbugError:
    """Make the exception of a status (its number in ``include/shutterbug.h``) with a sentence, or with what the status means."""
    name, meaning = _STATUSES[status] if 0 <= status < len(_STATUSES) else ("VULKAN", f"status {status}")
    error = _OF_NAME.get(name, VulkanError)(sentence or meaning)
    error.status = name
    return error
