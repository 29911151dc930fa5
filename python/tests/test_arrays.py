"""Arrays in and out: kinds, types, layouts in memory, and what is copied."""

import tracemalloc

import array_api_strict
import numpy as np
import pytest

from shutterbug import Camera, _arrays, errors

import oracle


@pytest.fixture
def cam(device):
    return Camera(128, 96, fovy=50)


def test_layouts_in_memory_are_read_where_they_lie(cam, picture):
    padded = np.zeros((96, 150, 3), np.uint8)
    padded[:, 5:133] = picture
    upside_down = np.ascontiguousarray(picture[::-1])[::-1]
    frozen = picture.copy()
    frozen.flags.writeable = False
    for array in (padded[:, 5:133], upside_down, frozen):
        assert not array.flags.c_contiguous or not array.flags.writeable
        assert _arrays.pixels(array, [np.uint8], np.uint8).ctypes.data == array.ctypes.data
        assert np.array_equal(cam(array), picture)
    # Others are copied, and right all the same.
    for array in (picture[:, ::-1], np.asfortranarray(picture), np.repeat(picture, 2, axis=1)[:, ::2]):
        assert np.array_equal(cam(array), array)


def test_nothing_of_the_size_of_a_picture_is_allocated_on_the_way(cam, picture):
    out = np.empty_like(picture)
    assert cam(picture, out=out) is out
    tracemalloc.start()
    cam(picture, out=out)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # The motion of a picture at rest, (96, 128, 2) of float32, and small things; not the picture.
    assert peak < 96 * 128 * 8 + 20_000
    assert np.array_equal(out, picture)


def test_floats_come_back_as_floats(cam, picture):
    linear = oracle.linear(picture).astype(np.float32)
    for dtype in (np.float32, np.float64, np.float16):
        out = cam(linear.astype(dtype))
        assert out.dtype == dtype and np.abs(oracle.srgb(out.astype(float)) - picture).max() <= 1.2
        encoded = cam((picture / 255).astype(dtype), encoding="srgb")
        assert encoded.dtype == dtype and np.abs(encoded.astype(float) * 255 - picture).max() < 1.1
    # More than white is cut by the sensor, and a byte read as linear is another light.
    assert cam(np.full((96, 128, 3), 4, np.float32)).max() == 1
    assert np.abs(cam(picture, encoding="linear").astype(int) - picture).max() <= 8


def test_four_channels_stay_four(cam, picture):
    rgba = np.dstack([picture, np.full((96, 128), 9, np.uint8)])
    out = cam(rgba)
    assert out.shape == (96, 128, 4) and np.array_equal(out[..., :3], picture) and (out[..., 3] == 255).all()


def test_dlpack_in_is_dlpack_out(cam, picture):
    strict = array_api_strict.asarray(picture)
    out = cam(strict)
    assert type(out) is type(strict) and np.array_equal(np.from_dlpack(out), picture)
    assert _arrays.to_numpy(strict, "x").ctypes.data == np.from_dlpack(strict).ctypes.data
    torch = pytest.importorskip("torch", reason="torch is not installed")
    tensor = torch.from_numpy(picture)
    assert isinstance(cam(tensor), torch.Tensor) and torch.equal(cam(tensor), tensor)
    assert _arrays.to_numpy(tensor, "x").ctypes.data == tensor.data_ptr()


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros((96, 128), np.uint8),
        np.zeros((96, 128, 2), np.uint8),
        np.zeros((96, 128, 3), np.int64),
        np.zeros((95, 128, 3), np.uint8),
        np.zeros((97, 128, 3), np.uint8),
        np.zeros((0, 0, 3), np.uint8),
        "picture",
        None,
    ],
)
def test_wrong_arrays_are_refused_with_a_sentence(cam, picture, wrong):
    with pytest.raises(errors.ArgumentError, match=r"expected|shape"):
        cam(wrong)
    assert np.array_equal(cam(picture), picture)


def test_wrong_targets_are_refused(cam, picture):
    frozen = np.empty_like(picture)
    frozen.flags.writeable = False
    for out in (np.empty((96, 127, 3), np.uint8), np.empty((96, 128, 3), np.float32), frozen):
        with pytest.raises(ValueError, match=r"^out is .* is expected|read-only"):
            cam(picture, out=out)
