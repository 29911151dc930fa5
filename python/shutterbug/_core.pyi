"""
The compiled part: the C ABI as objects. `shutterbug` is what to use; this has no promise of staying as it is.
"""

from collections.abc import Sequence
from numpy import float64
from numpy.typing import NDArray
from typing import Any, Final, final

__all__ = ["VERSION", "Engine", "Frame", "Poses", "check_camera", "check_conventions", "devices", "import_camera", "motion_preset", "preset_text", "presets", "run_command_line", "statuses"]

VERSION: Final[str]

@final
class Engine:
    """
    An engine of the C ABI.
    """
    def __new__(cls, /, device: str | None = None, driver: str | None = None, seed: int = 0, limits: tuple[int, int, int] = ..., time_limit_s: float = 0.0) -> Engine:
        """
        Opens a device: `device` is an index, UUID or part of a name; `driver` is the file of a Vulkan driver that is
        asked without a loader; `limits` are frames in flight, the number of the method, and blur samples at most.
        """
    def close(self, /) -> None:
        """
        Waits for what is in flight and frees all.
        """
    def info(self, /) -> "dict[str, Any]":
        """
        What the engine runs on.
        """
    def margin(self, /, turn_rate_rad_s: float, speed_m_s: float = 0.0, nearest_m: float = 0.0, color_delay_s: float = 0.0) -> tuple[int, int]:
        """
        Columns and rows that a frame needs beyond each side when the camera moves so at most.
        """
    def reset_exposure(self, /) -> None:
        """
        Automatic exposure begins anew.
        """
    def set_camera(self, /, text: str) -> None:
        """
        Sets the camera by the text of a `camera.toml`.
        """
    def submit(self, /, given: "dict[str, Any]") -> Frame:
        """
        Hands a frame to the device.
        """

@final
class Frame:
    """
    A frame of the C ABI.
    """
    def close(self, /) -> None:
        """
        Frees the frame; one in flight is waited for.
        """
    def info(self, /) -> "dict[str, Any]":
        """
        When the frame was taken and how long it took.
        """
    def read_into(self, /, plane: int, format: int, to: Any) -> None:
        """
        Copies a plane (1 the picture, 5 the radiance, 6 raw) in a format of `shutterbug_image` to an array of the
        camera's size.
        """
    def ready(self, /) -> bool:
        """
        Whether `wait` would return at once.
        """
    def times(self, /) -> list[tuple[str, float]]:
        """
        Names of the passes and their times on the device, ms.
        """
    def wait(self, /, limit_s: float = ...) -> None:
        """
        Waits at most `limit_s` seconds (below 0: ten minutes) and takes the frame from the device. Ctrl-C ends the
        wait; the frame can be waited for again.
        """

@final
class Poses:
    """
    Poses over time in the library's own convention.
    """
    def __len__(self, /) -> int: ...
    def __new__(cls, /, times_s: NDArray[float64], values: NDArray[float64], form: int, axes: int, direction: int, metres: float) -> Poses:
        """
        `times_s`: (n) of float64, s. `values`: (n, 16) of float64, 4x4 matrices row by row, or (n, 7). `form`, `axes`
        and `direction` are the numbers of `shutterbug_pose_convention`; `metres` is one unit of the translation.
        """
    def values(self, /) -> list[list[float]]:
        """
        The poses as (time, x, y, z, qx, qy, qz, qw), s and m.
        """

def check_camera(text: str, name: str) -> tuple[str, list[str]]:
    """
    Checks a `camera.toml` and returns the same camera with every parameter written out, and what is worth saying of it.
    """

def check_conventions(camera: tuple[int, int, float, float, float, float], colors: Sequence[Any], depths: Sequence[Any], poses: Poses) -> tuple[int, int, float, float, str]:
    """
    Whether two frames agree with what is said of their depth and poses: verdict, bits of the better convention, mean
    difference as given and at best, and a sentence. `camera`: (width, height, fx, fy, cx, cy). `poses`: two, as the
    user hands them in.
    """

def devices() -> "list[dict[str, Any]]":
    """
    The devices that the machine's Vulkan loader finds, best first, as dictionaries.
    """

def import_camera(text: str, name: str, format: str | None = None, camera: str | None = None, rate_hz: float | None = None) -> tuple[str, list[str]]:
    """
    A camera in another tool's format (`toml`, `ros`, `kalibr`, `euroc`, `gyroflow`; `None`: the content decides) as
    `camera.toml`, and what that cannot hold. `rate_hz` counts where the text does not say it.
    """

def motion_preset(preset: int) -> tuple[int, int, int, tuple[float, float], float]:
    """
    A preset of `shutterbug_motion_preset` by its number: direction, unit, y axis, scale and interval.
    """

def preset_text(name: str) -> str:
    """
    A preset's `camera.toml`, with the source of every number as comments.
    """

def presets() -> list[tuple[str, str]]:
    """
    Names of the presets, each with a line about it.
    """

def run_command_line(args: Sequence[str]) -> int:
    """
    Runs the command line in this process, whose signals it takes over, and returns its exit code. The first argument is
    the program's name.
    """

def statuses() -> list[tuple[str, str]]:
    """
    Names and meanings of all statuses, in the order of their numbers.
    """
