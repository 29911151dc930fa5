"""`shutterbug.newton.SensorCamera` against Newton's own sensor, one row of rays at a time."""

import numpy as np
import pytest

from shutterbug import Camera, errors

newton = pytest.importorskip("newton", reason="newton is not installed (575 MB)")
warp = pytest.importorskip("warp")
sn = pytest.importorskip("shutterbug.newton")

pytestmark = pytest.mark.usefixtures("device")
WIDTH, HEIGHT, READOUT, STEP, END = 320, 240, 0.03, 0.002, 0.115
START = END - READOUT
ROWS = range(3, HEIGHT, 4)


@pytest.fixture(scope="module")
def world():
    warp.config.quiet = True
    builder = newton.ModelBuilder()
    builder.add_ground_plane()
    builder.add_shape_box(builder.add_body(), hx=0.3, hy=0.3, hz=0.3)
    at = lambda *p: warp.transform(p, warp.quat_identity())  # noqa: E731
    builder.add_shape_sphere(-1, xform=at(1.1, 2.2, 0.4), radius=0.4)
    builder.add_shape_capsule(-1, xform=at(-1.2, 1.5, 0.6), radius=0.25, half_height=0.4)
    builder.add_shape_box(-1, xform=at(0, 4, 1.5), hx=4, hy=0.1, hz=1.5)
    model = builder.finalize(device="cpu")
    sensor = newton.sensors.SensorCamera(model)
    sensor.create_default_light()
    sensor.assign_checkerboard_material(shape_indices=[0, 1, 4])
    return model, sensor


def turned(angle, place=(0, -1.5, 1)):
    """World from camera: looks along +y, a little down, turned to the left by an angle."""
    c, s = np.cos(angle), np.sin(angle)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, 0.1, -0.995], [0, 0.995, 0.1]])
    pose[:3, 3] = place
    u, _, v = np.linalg.svd(pose[:3, :3])
    pose[:3, :3] = u @ v
    return pose


def rest(t):
    return np.array([[0, 1, 0.5, 0, 0, 0, 1]])


def spinning(t):
    s = t - 0.1
    return np.array([[3 * s, 1, 0.5 + s, 0, 0, np.sin(5 * s), np.cos(5 * s)]])


MOTIONS = {
    "pan": (lambda t: turned(3 * (t - 0.1)), rest, 36),
    "walk": (
        lambda t: turned(0.12 * np.sin(11.3 * t - 1.1), (0.03 * np.sin(5.6 * t), -1.5 + 1.3 * (t - 0.1), 1 + 0.03 * np.sin(11.3 * t))),
        rest,
        34,
    ),
    "vibration": (lambda t: turned(0.02 * np.sin(157 * t), (0.002 * np.sin(157 * t), -1.5, 1)), rest, 33),
    "moving body": (lambda t: turned(0.0), spinning, 36),
}


def truth(world, place, bodies):
    """Each row alone, at its own time: its rays from Newton's own pinhole, 16 a pixel."""
    model, sensor = world
    kind = newton.sensors.SensorCamera
    all_rays = kind.compute_camera_rays_pinhole(WIDTH, HEIGHT, camera_fov=np.radians(50), device="cpu").numpy()
    d = all_rays[..., 0, 1, :]
    flat = d / -d[..., 2:]
    across, down = flat[0, 1, 0] - flat[0, 0, 0], flat[1, 0, 1] - flat[0, 0, 1]
    offsets = (np.arange(4) + 0.5) / 4 - 0.5
    config = kind.RenderConfig(anti_aliasing=kind.AntiAliasing.SSAA)
    state, out = model.state(), np.zeros((len(ROWS), WIDTH, 3))
    for i, row in enumerate(ROWS):
        t = START + READOUT * row / HEIGHT
        rays = np.zeros((1, WIDTH, 16, 2, 3), np.float32)
        for n, (b, a) in enumerate([(b, a) for b in offsets for a in offsets]):
            rays[0, :, n, 1] = flat[row] + [0, b * down, 0]
            rays[0, :, n, 1, 0] += a * across
        rays[..., 1, :] /= np.linalg.norm(rays[..., 1, :], axis=-1, keepdims=True)
        state.body_q.assign(bodies(t).astype(np.float32))
        model.bvh_refit_shapes(state)
        hdr = sensor.allocate_image_color_hdr(1, WIDTH, 1)
        at = warp.array([sn._transform(place(t))], dtype=warp.transformf, device="cpu")
        sensor.update(state, at, warp.array(rays, dtype=warp.vec3f, device="cpu"), hdr_color_image=hdr, render_config=config)
        out[i] = hdr.numpy()[0, 0]
    return srgb(np.clip(out, 0, 1))


def srgb(value):
    return np.where(value <= 0.0031308, value * 12.92, 1.055 * np.maximum(value, 1e-9) ** (1 / 2.4) - 0.055) * 255


def psnr(a, b):
    return 10 * np.log10(255**2 / np.mean((np.asarray(a, float) - b) ** 2))


def delivered(world, place, bodies, cam, **options):
    model, sensor = world
    state = model.state()
    with sn.SensorCamera(model, cam, place=place, sensor=sensor, samples=16, **options) as eye:
        for k in range(40, -1, -1):
            t = END - k * STEP
            state.body_q.assign(bodies(t).astype(np.float32))
            eye.record(state, t)
        assert eye.frame_time_s == pytest.approx(END - cam.span()[1])
        return eye.render()


@pytest.mark.parametrize("name", MOTIONS)
def test_rolling_shutter_is_that_of_rows_rendered_one_by_one(world, name):
    place, bodies, goal = MOTIONS[name]
    rows = truth(world, place, bodies)
    cam = Camera(WIDTH, HEIGHT, fovy=50, readout_time_s=READOUT)
    one = psnr(delivered(world, place, bodies, cam)[ROWS], rows)
    three = psnr(delivered(world, place, bodies, cam, pictures=3)[ROWS], rows)
    middle = (START + END) / 2
    still = delivered(world, lambda t: place(middle), lambda t: bodies(middle), Camera(WIDTH, HEIGHT, fovy=50))
    own = psnr(still[ROWS], rows)
    print(f"{name}: one picture {one:.1f} dB, three {three:.1f} dB, without a shutter {own:.1f} dB")
    assert one >= goal and three >= 38
    assert own < one - 6


def test_a_camera_on_a_body_is_where_the_body_is(world):
    model, sensor = world
    state = model.state()
    state.body_q.assign(np.array([[0, -1.5, 1, 0, 0, 0, 1]], np.float32))
    cam = Camera(64, 48, fovy=50)
    seat = turned(0.0, (0, 0, 0))
    with sn.SensorCamera(model, cam, body=0, place=seat, sensor=sensor) as on_body:
        on_body.record(state, 0.0)
        mounted = on_body.render()
    with sn.SensorCamera(model, cam, place=lambda t: turned(0.0), sensor=sensor) as free:
        free.record(state, 0.0)
        assert np.array_equal(free.render(), mounted)


@pytest.mark.parametrize(("output", "dtype"), [("uint8", np.uint8), ("uint16", np.uint16), ("float32", np.float32), ("raw12", np.uint16)])
def test_an_output_has_the_bits_of_the_camera_called_directly(world, handed, output, dtype):
    effects = {"bayer_mosaic": {"pattern": "RGGB"}, "quantization": {"bits": 12}, "read_noise": {"sigma": 0.01}}
    cam = Camera(64, 48, fovy=50, readout_time_s=READOUT, seed=5, effects=effects)
    seen = delivered(world, lambda t: turned(3 * (t - 0.1)), rest, cam, output=output)
    _, rgb, given = handed[-1]
    assert seen.dtype == dtype and seen.shape == ((48, 64) if output == "raw12" else (48, 64, 3))
    alone = cam.with_effects({})
    assert seen.tobytes() == alone(rgb, **{**given, "output": output}).tobytes()
    # The controls: other noise, and another instant.
    assert seen.tobytes() != alone(rgb, **{**given, "output": output, "frame": 7}).tobytes()
    assert seen.tobytes() != alone(rgb, **{**given, "output": output, "color_time": given["color_time"] + 0.005}).tobytes()


def test_wrong_use_is_refused(world):
    model, _ = world
    cam = Camera(64, 48, fovy=50)
    for options in ({"pictures": 0}, {"body": 7}, {"samples": 3}):
        with pytest.raises(errors.ArgumentError, match="pictures"):
            sn.SensorCamera(model, cam, **options)
    with pytest.raises(errors.ArgumentError, match="raw11"):
        sn.SensorCamera(model, cam, output="raw11")
    with pytest.raises(RuntimeError, match="record"):
        sn.SensorCamera(model, cam).render()
