"""SwiftShader, a Vulkan driver that needs no GPU, no loader and nothing to be installed, for the package `shutterbug`.

`shutterbug` asks it where the machine has neither a GPU's driver nor a software driver of its own. It is slower than those.
"""

from pathlib import Path

__all__ = ["icd_path", "library_path"]

_FOLDER = Path(__file__).parent


def library_path() -> Path:
    """Give the driver's file. It has a `vkGetInstanceProcAddr`, so it can be asked without a loader."""
    return _FOLDER / "libvk_swiftshader.so"


def icd_path() -> Path:
    """Give the manifest with which a Vulkan loader finds it: ``VK_DRIVER_FILES``."""
    return _FOLDER / "vk_swiftshader_icd.json"
