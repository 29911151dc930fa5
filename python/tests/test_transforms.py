"""`shutterbug.transforms` in the three ways of calling, and with drawn parameters."""

import pickle

import array_api_strict
import numpy as np
import pytest

from shutterbug import Camera, errors, transforms

pytestmark = pytest.mark.usefixtures("device")
NOISE = Camera(128, 96, fovy=50, effects={"read_noise": {"sigma": 0.03}})
SHUTTER = Camera(128, 96, fovy=50, readout_time_s=0.02)


def test_three_ways_of_calling_are_one(picture):
    def fresh():
        return transforms.Camera(NOISE, seed=4)

    alone = fresh()(picture)
    assert np.array_equal(fresh()({"image": picture, "label": 7})["image"], alone)
    assert np.array_equal(fresh()(image=picture, label=7)["image"], alone)
    assert fresh()(image=picture, label=7)["label"] == 7
    assert alone.dtype == np.uint8 and not np.array_equal(alone, picture)
    floats = fresh()(picture.astype(np.float32) / 255)
    assert floats.dtype == np.float32 and np.abs(floats * 255 - alone).max() < 1.01


def test_a_batch_is_its_images(picture):
    batch = transforms.Camera(NOISE, seed=4)(np.stack([picture, picture]))
    assert batch.shape == (2, 96, 128, 3) and not np.array_equal(batch[0], batch[1])
    strict = transforms.Camera(NOISE, seed=4)(array_api_strict.asarray(picture))
    assert np.array_equal(np.from_dlpack(strict), batch[0])


def test_images_of_torch_are_planar(picture):
    torch = pytest.importorskip("torch", reason="torch is not installed")
    planar = torch.from_numpy(np.ascontiguousarray(np.moveaxis(picture, -1, 0)))
    made = transforms.Camera(NOISE, seed=4)(planar)
    assert np.array_equal(np.moveaxis(made.numpy(), 0, -1), transforms.Camera(NOISE, seed=4)(picture))


def test_torchvision_composes_it(picture):
    """v2 hands dictionaries from transform to transform: ours stands between two of theirs."""
    torch = pytest.importorskip("torch", reason="torch is not installed")
    v2 = pytest.importorskip("torchvision.transforms.v2", reason="torchvision is not installed")
    planar = torch.from_numpy(np.ascontiguousarray(np.moveaxis(picture, -1, 0)))
    both = v2.Compose([v2.RandomHorizontalFlip(p=1.0), transforms.Camera(NOISE, seed=4), v2.ToDtype(torch.float32, scale=True)])
    made = both({"image": planar, "label": 3})
    assert made["label"] == 3 and made["image"].shape == (3, 96, 128) and made["image"].dtype == torch.float32
    expected = transforms.Camera(NOISE, seed=4)(np.ascontiguousarray(picture[:, ::-1]))
    assert np.array_equal(np.moveaxis((made["image"].numpy() * 255).round().astype(np.uint8), 0, -1), expected)


def test_albumentations_composes_it(picture):
    """Beside a pipeline of theirs by keywords, and inside one as the function of a Lambda."""
    a = pytest.importorskip("albumentations", reason="albumentations is not installed")
    ours = transforms.Camera(NOISE, seed=4)
    flipped = a.Compose([a.HorizontalFlip(p=1.0)])(**transforms.Camera(NOISE, seed=4)(image=picture))["image"]
    assert np.array_equal(flipped[:, ::-1], transforms.Camera(NOISE, seed=4)(picture))
    inside = a.Compose([a.Lambda(image=lambda image, **_: ours(image), p=1.0), a.HorizontalFlip(p=1.0)])(image=picture)["image"]
    assert np.array_equal(inside, flipped)


def test_kornia_takes_its_batches(picture):
    """(n, 3, height, width) of floats from 0 to 1."""
    torch = pytest.importorskip("torch", reason="torch is not installed")
    augmentation = pytest.importorskip("kornia.augmentation", reason="kornia is not installed")
    planar = torch.from_numpy(np.moveaxis(picture, -1, 0) / np.float32(255))
    batch = transforms.Camera(NOISE, seed=4)(torch.stack([planar, planar]))
    assert batch.shape == (2, 3, 96, 128) and batch.dtype == torch.float32 and not torch.equal(batch[0], batch[1])
    flipped = augmentation.RandomHorizontalFlip(p=1.0)(batch)
    assert torch.equal(flipped.flip(-1), batch)


def test_a_shutter_needs_to_know_what_moved(picture):
    augment = transforms.Camera(SHUTTER)
    with pytest.raises(errors.MissingMotionError, match="depth and poses"):
        augment(image=picture)
    flow = np.full((96, 128, 2), 6, np.float32)
    assert not np.array_equal(augment(image=picture, motion=flow)["image"], picture)
    assert np.array_equal(augment(image=picture, still=True)["image"], picture)


def test_samples_with_a_number_do_not_depend_on_their_order(picture):
    samples = [{"image": picture, "index": i} for i in range(6)]
    ranges = transforms.Ranges({"read_noise.sigma": (0.0, 0.1), "gamma.exponent": (0.8, 1.2)})
    forward = [transforms.Camera(NOISE, p=0.5, ranges=ranges)(s)["image"] for s in samples]
    one = transforms.Camera(NOISE, p=0.5, ranges=ranges)
    backward = [one(s)["image"] for s in reversed(samples)][::-1]
    assert all(np.array_equal(a, b) for a, b in zip(forward, backward, strict=True))
    untouched = sum(np.array_equal(f, picture) for f in forward)
    assert 0 < untouched < 6
    assert NOISE.effects["read_noise"]["sigma"] == 0.03
    again = pickle.loads(pickle.dumps(one))
    assert np.array_equal(again(samples[0])["image"], forward[0])


def test_ranges_come_from_a_presets_spread_and_are_kept():
    phone = Camera.preset("phone")
    ranges = transforms.Ranges.around(phone, 0.1)
    assert ranges.values["rolling_shutter.readout_time_s"] == pytest.approx((0.018612, 0.022748))
    generator = np.random.default_rng(0)
    drawn = [ranges.draw(generator)["rolling_shutter"]["readout_time_s"] for _ in range(200)]
    assert 0.0186 < min(drawn) < 0.0192 and 0.0221 < max(drawn) < 0.02275
    for wrong in ({"read_noise": (0, 1)}, {"read_noise.sigma": ()}):
        with pytest.raises(errors.ArgumentError):
            transforms.Ranges(wrong)


def test_sizes_follow_the_image(picture):
    augment = transforms.Camera(NOISE)
    for size in (picture, picture[:64, :64], picture[:32], picture):
        assert augment(size).shape == size.shape
