"""Frames in more than 8 bits and as the converter's own numbers: each against the others, and against the definition."""

import numpy as np
import pytest

from shutterbug import Camera, errors

import oracle

NOISE = {"read_noise": {"sigma": 0.01}, "shot_noise": {"full_well_e": 4000.0}}
PATTERN = "GRBG"


def mosaic(bits, **more):
    return {"bayer_mosaic": {"pattern": PATTERN}, "quantization": {"bits": bits}, "black_level": {"offset": 0.0625}, **more}


@pytest.fixture
def noisy():
    return Camera(128, 96, fovy=50, effects=NOISE, seed=4)


def test_16_bits_and_floats_are_the_picture_less_rounded(device, noisy, picture):
    plain = noisy(picture, frame=2)
    with noisy.submit(picture, frame=2, output=("uint16", "float32")) as frame:
        wide, linear, again = frame.result(), frame.read("float32"), frame.read("uint8")
    assert np.array_equal(again, plain), "the picture is none other for it"
    assert (wide.dtype, wide.shape, linear.dtype, linear.shape) == (np.uint16, plain.shape, np.float32, plain.shape)
    off = np.abs(wide / 257.0 - plain)
    assert 0.45 < off.max() < 0.503, "half a step of 8 bits, and no more"
    assert (wide % 257 != 0).any(), "control: there is more than 8 bits in it"
    assert np.abs(oracle.srgb(linear) * 257 - wide).max() < 0.8
    assert np.abs(linear * 65535 - wide).max() > 3000, "control: linear is not sRGB"
    assert noisy(picture, frame=2, output=np.uint16).tobytes() == wide.tobytes()


def test_floats_keep_what_8_bits_lose(device):
    dark = np.linspace(0, 0.004, 128 * 96 * 3, dtype=np.float32).reshape(96, 128, 3)
    cam = Camera(128, 96, fovy=50)
    assert np.abs(cam(dark, output="float32") - dark).max() < 3e-5
    assert np.abs(cam(dark) - dark).max() > 1e-4, "control: steps of 8 bits"
    encoded = np.full((96, 128, 3), 0.5, np.float32)
    out = cam(encoded, encoding="srgb", output="float32")
    assert np.abs(out - 0.5).max() < 1e-3
    assert np.abs(cam(encoded, output="float32") - 0.5).max() < 1e-3 and cam(encoded)[0, 0, 0] != out[0, 0, 0]


def test_four_channels_and_arrays_of_ones_own(device, noisy, picture):
    four = np.dstack([picture, np.full((96, 128), 255, np.uint8)])
    wide = noisy(four, output="uint16")
    assert wide.shape == (96, 128, 4) and (wide[..., 3] == 65535).all()
    assert np.array_equal(wide[..., :3], noisy(picture, output="uint16"))
    out = np.zeros((96, 128, 3), np.uint16)
    assert noisy(picture, output="uint16", out=out) is out and np.array_equal(out, wide[..., :3])
    rgba = np.zeros((96, 128, 4), np.float32)
    assert noisy(picture, output="float32", out=rgba) is rgba
    assert np.array_equal(rgba[..., :3], noisy(picture, output="float32")) and (rgba[..., 3] == 1).all()
    with pytest.raises(errors.ArgumentError, match="uint16"):
        noisy(picture, output="uint16", out=np.zeros((96, 128, 3), np.uint8))


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_raw_is_what_the_converter_makes_of_the_light_behind_each_filter(device, picture, bits):
    cam = Camera(128, 96, fovy=50, effects=mosaic(bits, white_balance={"r": 1.7}))
    with cam.submit(picture, output=f"raw{bits}", radiance=True) as frame:
        raw, light = frame.result(), frame.radiance()
    assert raw.dtype == np.uint16 and raw.shape == (96, 128)

    def expected(pattern, black=0.0625):
        channel = np.array(["RGB".index(c) for c in pattern]).reshape(2, 2)
        seen = np.take_along_axis(light, np.tile(channel, (48, 64))[..., None], axis=2)[..., 0]
        return np.floor((black + (1 - black) * seen.astype(np.float64)).clip(0, 1) * (2**bits - 1) + 0.5)

    assert np.abs(raw - expected(PATTERN)).max() <= 1
    # Controls: another pattern, and no black level.
    assert np.abs(raw - expected("RGGB")).max() > 2 ** (bits - 4)
    assert np.abs(raw - expected(PATTERN, 0.0)).max() > 2 ** (bits - 6)


def unpacked(rows, bits):
    """MIPI CSI-2: high bytes of a group's pixels, then their low bits as one little-endian number."""
    pixels, low = (2 if bits == 12 else 4), bits - 8
    groups = rows.reshape(rows.shape[0], -1, pixels * bits // 8).astype(np.uint64)
    rest = sum(groups[..., pixels + i] << np.uint64(8 * i) for i in range(groups.shape[2] - pixels))
    each = [(groups[..., p] << np.uint64(low)) | (rest >> np.uint64(low * p)) & np.uint64((1 << low) - 1) for p in range(pixels)]
    return np.stack(each, axis=-1).reshape(rows.shape[0], -1)


@pytest.mark.parametrize("bits", [10, 12, 14])
def test_packed_rows_hold_the_same_numbers(device, picture, bits):
    cam = Camera(128, 96, fovy=50, effects=mosaic(bits) | NOISE)
    with cam.submit(picture, output=(f"mipi{bits}", f"raw{bits}")) as frame:
        packed, raw = frame.result(), frame.read(f"raw{bits}")
    assert packed.dtype == np.uint8 and packed.shape == (96, 128 * bits // 8)
    assert np.array_equal(unpacked(packed, bits), raw) and raw.std() > 2 ** (bits - 5)


def test_dlpack_in_gives_dlpack_out(device, noisy, picture):
    other = pytest.importorskip("array_api_strict")
    out = noisy(other.asarray(picture), output="uint16")
    assert type(out).__module__.startswith("array_api_strict")
    assert np.array_equal(np.from_dlpack(out), noisy(picture, output="uint16"))


def test_outputs_at_rest_and_in_motion(device, picture):
    """The way by `still` drops nothing of what was asked for, and a shutter is in every output."""
    cam = Camera(128, 96, fovy=50, exposure_time_s=0.01)
    flow = np.full((96, 128, 2), 20.0, np.float32)
    still, moved = cam(picture, still=True, output="uint16"), cam(picture, motion=flow, output="uint16")
    assert np.abs(still / 257.0 - picture).max() < 0.51
    assert np.abs(moved.astype(int) - still).max() > 5000
    assert np.abs(moved / 257.0 - cam(picture, motion=flow)).max() < 0.51


def test_what_cannot_be_read_is_refused(device, noisy, picture):
    for wrong in ("rgb", np.int8, object(), ("uint16", "raw11")):
        with pytest.raises(errors.ArgumentError, match="raw10"):
            noisy(picture, output=wrong)
    with pytest.raises(errors.InputError, match="bayer_mosaic"):
        noisy(picture, output="raw10")
    with noisy.submit(picture) as frame, pytest.raises(errors.StateError):
        frame.read("uint16")
    narrow = Camera(126, 96, fovy=50, effects=mosaic(10))
    with pytest.raises(errors.ArgumentError, match="126"):
        narrow(np.ascontiguousarray(picture[:, 1:-1]), output="mipi10")
    jpeg = Camera(128, 96, fovy=50, effects={"jpeg": {"quality": 80}})
    with pytest.raises(errors.UnsupportedError):
        jpeg(picture, output="float32")
    # Nothing is broken by it.
    assert noisy(picture, output="uint16").shape == (96, 128, 3)
