"""Transforms for data sets: dictionaries in, dictionaries out, as torchvision v2, albumentations and kornia are called.

>>> augment = shutterbug.transforms.Camera(cam, p=0.5)
>>> sample = augment({"image": image, "depth": depth, "poses": poses})      # torchvision v2
>>> sample = augment(image=image, depth=depth, poses=poses)                 # albumentations
>>> image = augment(image)                                                  # an image alone: effects on values

Effects on values (noise, colour, sharpness, compression) act on any image. Rolling shutter and blur need to know what moved: a sample
that has neither `depth` and `poses` nor `motion` is an error that says so, never a blur along a made-up line.
"""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Mapping
from typing import Any

import numpy as np

from ._arrays import like, to_numpy
from .camera import Camera as _Camera
from .errors import ArgumentError
from .folders import Diagnosis

__all__ = ["Camera", "Ranges"]

# Sizes of images whose cameras are kept open.
_OPEN = 4
_GIVEN = (
    "depth", "poses", "ids", "bodies", "motion", "pictures", "still", "time", "color_time", "nearest_m", "border", "axes", "direction",
    "quaternion", "depth_is", "motion_is", "motion_times", "encoding",
)  # fmt: skip


class Ranges:
    """Parameters drawn anew for each sample, from `values`: ``{"read_noise.sigma": (0.0, 0.02)}``, evenly between the two, or from a list
    of more than two values, one of them.
    """

    def __init__(self, values: Mapping[str, Any]) -> None:
        """Keep ranges by ``"effect.parameter"``. ArgumentError: a name without a dot, or no values."""
        for name, choice in values.items():
            if name.count(".") != 1 or len(choice) == 0:
                raise ArgumentError(f"{name!r}: {choice!r}: 'effect.parameter' and (low, high), or a list of values, is expected")
        self.values = dict(values)

    @classmethod
    def around(cls, camera: _Camera, spread: float = 0.2) -> Ranges:
        """Give ranges of every number of the effects of `camera`, from ``1 - spread`` to ``1 + spread`` times its value; `spread`: 0 to 1.

        For a preset: cameras of its kind differ so. Values of 0 and whole numbers stay.
        """
        found = {}
        for effect, parameters in camera.effects.items():
            for name, value in parameters.items():
                if isinstance(value, float) and value != 0:
                    ends = value * (1 - spread), value * (1 + spread)
                    found[f"{effect}.{name}"] = (min(ends), max(ends))
        return cls(found)

    @classmethod
    def of_diagnosis(cls, diagnosis: Diagnosis) -> Ranges:
        """Give the intervals of 95 % that `diagnosis` found: train on the camera that you measured. OSError: its folder is there no
        more.
        """
        rows = [r for r in diagnosis.effects if r["low"] is not None and r["high"] is not None]
        names = diagnosis.camera.effects
        return cls({f"{r['effect']}.{r['parameter']}": (r["low"], r["high"]) for r in rows if r["effect"] in names})

    def draw(self, generator: np.random.Generator) -> dict[str, dict[str, Any]]:
        """Give tables of effects with values drawn by `generator`, one of numpy's."""
        tables: dict[str, dict[str, Any]] = {}
        for name, choice in self.values.items():
            effect, parameter = name.split(".")
            numbers = len(choice) == 2 and all(isinstance(c, int | float) for c in choice)
            value = generator.uniform(*choice) if numbers else choice[int(generator.integers(len(choice)))]
            tables.setdefault(effect, {})[parameter] = value
        return tables


class Camera:
    """What a camera would have delivered of each sample, with a chance of `p`.

    Called with an image, with keywords (albumentations) or with a dictionary (torchvision v2); gives the same back. The image, under
    `key`, is (height, width, 3) in numpy and (3, height, width) in PyTorch, uint8 or floats from 0 to 1, both sRGB; a further leading
    side is a batch. All else of the sample passes through; `depth`, `poses`, `ids`, `bodies`, `motion`, `still`, `time` and
    the like are used as of `shutterbug.Camera.submit`.
    """

    def __init__(
        self,
        camera: _Camera,
        p: float = 1.0,
        *,
        ranges: Ranges | None = None,
        seed: int = 0,
        key: str = "image",
    ) -> None:
        """Make a transform. `camera`: its size becomes the image's. `p`: chance, 0 to 1. `ranges`: drawn for each sample. `seed`: samples
        are drawn by seed and count, or by the sample's own ``"index"`` where it has one: then the same bits in any order and in any
        number of workers. `key`: the image's in a dictionary. ArgumentError: `p` is no chance.
        """
        if not 0 <= p <= 1:
            raise ArgumentError(f"p is {p}: 0 to 1 is expected")
        self.camera, self.p, self.ranges, self.seed, self.key = camera, p, ranges, seed, key
        self._count = 0
        # The camera is changed for each sample: one at a time.
        self._lock = threading.Lock()
        self._open: OrderedDict[tuple[int, int], _Camera] = OrderedDict()

    def __call__(self, *args: Any, **sample: Any) -> Any:
        """Give the sample with its image delivered by the camera. MissingMotionError: it has a shutter or blur, and the sample does not say
        what moved; else errors of `shutterbug.Camera.submit`.
        """
        if args and isinstance(args[0], Mapping):
            return self._apply(dict(args[0]))
        if args:
            return self._apply({self.key: args[0], **sample})[self.key]
        return self._apply(sample)

    forward = __call__

    def __repr__(self) -> str:
        return f"Camera({self.camera!r}, p={self.p})"

    def _apply(self, sample: dict[str, Any]) -> dict[str, Any]:
        if self.key not in sample:
            raise ArgumentError(f"the sample has no {self.key!r}: {', '.join(sample)}")
        number = sample.get("index", self._count)
        self._count += 1
        digest = hashlib.sha256(f"{self.seed}/{number}".encode()).digest()
        generator = np.random.default_rng(list(digest))
        if generator.random() >= self.p:
            return sample
        image = sample[self.key]
        frame = int.from_bytes(digest[:4], "little")
        if getattr(image, "ndim", 3) == 4:
            made = [self._one(i, sample, generator, (frame + k) % 2**32) for k, i in enumerate(image)]
            return {**sample, self.key: like(image)(np.stack([to_numpy(m, "image") for m in made]))}
        return {**sample, self.key: self._one(image, sample, generator, frame)}

    def _one(self, image: Any, sample: dict[str, Any], generator: np.random.Generator, frame: int) -> Any:
        array = to_numpy(image, "image")
        planar = type(image).__module__.split(".")[0] in ("torch", "torchvision") and array.ndim == 3
        pixels = np.moveaxis(array, 0, -1) if planar else array
        tables = {} if self.ranges is None else self.ranges.draw(generator)
        margin = self._margin(pixels, sample)
        given = {name: sample[name] for name in _GIVEN if name in sample}
        encoding = given.pop("encoding", "srgb")
        with self._lock:
            camera = self._camera_of((pixels.shape[1] - 2 * margin[0], pixels.shape[0] - 2 * margin[1]), tables)
            made = camera(pixels, frame=frame, encoding=encoding, **given)
        return like(image)(np.ascontiguousarray(np.moveaxis(made, -1, 0))) if planar else made

    @staticmethod
    def _margin(pixels: Any, sample: dict[str, Any]) -> tuple[int, int]:
        wide, high = sample.get("margin", (0, 0))
        return int(wide), int(high)

    def _camera_of(self, size: tuple[int, int], tables: dict[str, dict[str, Any]]) -> _Camera:
        wanted = self.camera
        if (wanted.width, wanted.height) != size:
            wanted = wanted.with_pinhole(*size)
        if tables:
            wanted = wanted.with_effects(tables)
        # Never the user's own, which is left as it is.
        kept = self._open.pop(size, None) or wanted.with_effects({})
        kept.become(wanted)
        self._open[size] = kept
        while len(self._open) > _OPEN:
            self._open.popitem(last=False)[1].close()
        return kept

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name not in ("_open", "_lock")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _open=OrderedDict(), _lock=threading.Lock())
