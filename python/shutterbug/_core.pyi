"""The compiled part: the C ABI as objects. `shutterbug` is what to use; this has no promise of staying as it is."""

from typing import Any, SupportsIndex, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "VERSION",
    "Engine",
    "Frame",
    "Poses",
    "check_camera",
    "check_conventions",
    "devices",
    "import_camera",
    "motion_preset",
    "preset_text",
    "presets",
    "run_command_line",
    "statuses",
]

VERSION: str

@final
class Poses:
    """Poses over time in the library's own convention."""

    def __new__(
        cls,
        times_s: npt.NDArray[np.float64],
        values: npt.NDArray[np.float64],
        form: int,
        axes: int,
        direction: int,
        metres: float,
    ) -> Poses:
        """(n) times, s, and (n, 16) or (n, 7) numbers, float64, in the convention of `shutterbug_pose_convention`."""

    def values(self) -> list[list[float]]:
        """Rows of time, x, y, z, qx, qy, qz, qw; s and m."""

    def __len__(self) -> int:
        """How many poses."""

@final
class Engine:
    """A device with a camera."""

    def __new__(
        cls,
        device: str | None = None,
        driver: str | None = None,
        seed: int = 0,
        limits: tuple[int, int, int] = (2, 0, 0),
        time_limit_s: float = 0.0,
    ) -> Engine:
        """Open a device."""

    def set_camera(self, text: str) -> None:
        """Set the camera by the text of a camera.toml."""

    def reset_exposure(self) -> None:
        """Begin automatic exposure anew."""

    def margin(
        self,
        turn_rate_rad_s: float,
        speed_m_s: float = 0.0,
        nearest_m: float = 0.0,
        color_delay_s: float = 0.0,
    ) -> tuple[int, int]:
        """Columns and rows that frames of such motion need beyond each side, px."""

    def submit(self, given: dict[str, Any]) -> Frame:
        """Hand a frame to the device; the names are those of `shutterbug_outside`."""

    def info(self) -> dict[str, Any]:
        """What it runs on."""

    def close(self) -> None:
        """Wait for what is in flight and free all."""

@final
class Frame:
    """A frame on its way, or delivered."""

    def wait(self, limit_s: float = -1.0) -> None:
        """Wait for it."""

    def ready(self) -> bool:
        """Whether `wait` would return at once."""

    def read_into(self, plane: int, format: int, to: npt.NDArray[Any]) -> None:
        """Copy a plane (1 the picture, 5 the radiance, 6 raw) into an array, in a format of `shutterbug_image`."""

    def info(self) -> dict[str, Any]:
        """When it was taken."""

    def times(self) -> list[tuple[str, float]]:
        """Passes and their times on the device, ms."""

    def close(self) -> None:
        """Free it."""

def check_camera(text: str, name: str) -> tuple[str, list[str]]:
    """Check a camera.toml: the same with every parameter, and warnings."""

def import_camera(
    text: str,
    name: str,
    format: str | None = None,
    camera: str | None = None,
    rate_hz: float | None = None,
) -> tuple[str, list[str]]:
    """Turn a camera of another format into camera.toml, and say what that cannot hold."""

def presets() -> list[tuple[str, str]]:
    """Names of the presets, each with a line about it."""

def preset_text(name: str) -> str:
    """Give a preset's camera.toml."""

def motion_preset(preset: SupportsIndex) -> tuple[int, int, int, tuple[float, float], float]:
    """Give a preset of `shutterbug_motion_preset`."""

def run_command_line(args: list[str]) -> int:
    """Run the command line in this process; its exit code."""

def check_conventions(
    camera: tuple[int, int, float, float, float, float],
    colors: list[Any],
    depths: list[Any],
    poses: Poses,
) -> tuple[int, int, float, float, str]:
    """Verdict, bits of the better convention, difference as given and at best, sentence."""

def devices() -> list[dict[str, Any]]:
    """List the devices of the machine's Vulkan loader, best first."""

def statuses() -> list[tuple[str, str]]:
    """Names and meanings of all statuses."""
