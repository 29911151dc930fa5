"""`shutterbug.mujoco.Renderer` against MuJoCo rendered row by row."""

import numpy as np
import pytest

from shutterbug import Camera, errors

import needs

needs.mujoco()

import mujoco  # noqa: E402

import shutterbug.mujoco as sm  # noqa: E402

import mujoco_truth as truth  # noqa: E402

pytestmark = pytest.mark.usefixtures("device")
ROWS = range(3, truth.HEIGHT, 8)
START = 0.1 - truth.READOUT_S / 2
END = START + truth.READOUT_S


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_string(truth.MODEL)


def camera(**options):
    return Camera(truth.WIDTH, truth.HEIGHT, fovy=50, readout_time_s=truth.READOUT_S, **options)


def delivered(model, motion, cam, end=END, **options):
    """What the renderer delivers of a motion whose states it hears step by step."""
    data = mujoco.MjData(model)
    with sm.Renderer(model, truth.HEIGHT, truth.WIDTH, camera=cam, **options) as renderer:
        for k in range(60, -1, -1):
            truth.place(model, data, motion, end - k * truth.STEP_S)
            renderer.record(data)
        renderer.update_scene(data, camera="eye")
        assert renderer.frame_time_s == pytest.approx(end - cam.span()[1])
        return renderer.render()


# Motion, goal in dB with one picture. With three, 38 throughout.
GOALS = [(truth.pan, 36), (truth.walk, 34), (truth.vibration, 33), (truth.moving_body, 36)]


@pytest.mark.parametrize(("motion", "goal"), GOALS, ids=lambda x: getattr(x, "__name__", ""))
def test_rolling_shutter_is_that_of_rows_rendered_one_by_one(model, motion, goal):
    rows = truth.srgb(truth.of_rows(model, motion, START, rows=ROWS))[ROWS]
    one = truth.psnr(delivered(model, motion, camera())[ROWS], rows)
    three = truth.psnr(delivered(model, motion, camera(), pictures=3)[ROWS], rows)
    # The control: MuJoCo's own picture of the frame's middle.
    data = mujoco.MjData(model)
    truth.place(model, data, motion, (START + END) / 2)
    with mujoco.Renderer(model, truth.HEIGHT, truth.WIDTH) as own:
        own.update_scene(data, camera="eye")
        middle = truth.psnr(own.render()[ROWS], rows)
    print(f"{motion.__name__}: one picture {one:.1f} dB, three {three:.1f} dB, MuJoCo's own {middle:.1f} dB")
    assert one >= goal + 4 and three >= 42
    assert middle < 36 and middle < one - 8


def test_shutter_and_blur_together(model):
    exposure = 0.01
    cam = camera(exposure_time_s=exposure)
    when = END - cam.span()[1]
    rows = range(0, truth.HEIGHT, 30)
    seen = truth.of_rows(model, truth.pan, when, exposures=(np.arange(10) + 0.5) / 10 * exposure, rows=rows)
    found = delivered(model, truth.pan, cam)
    assert truth.psnr(found[rows], truth.srgb(seen)[rows]) > 36
    sharp = delivered(model, truth.pan, camera(), end=END)
    assert truth.psnr(sharp[rows], truth.srgb(seen)[rows]) < 33


def test_without_effects_it_is_mujocos_own_picture(model):
    data = mujoco.MjData(model)
    truth.place(model, data, truth.pan, 0.1)
    with mujoco.Renderer(model, 120, 160) as own, sm.Renderer(model, 120, 160, camera=Camera(160, 120, fovy=50)) as ours:
        assert (ours.height, ours.width, ours.model) == (120, 160, model)
        for enable in (None, "depth", "segmentation"):
            for renderer in (own, ours):
                if enable:
                    getattr(renderer, f"enable_{enable}_rendering")()
                renderer.update_scene(data, camera="eye")
            theirs, out = own.render(), ours.render()
            assert out.dtype == theirs.dtype and out.shape == theirs.shape
            assert np.abs(out.astype(float) - theirs).max() <= 1e-3
            if enable:
                for renderer in (own, ours):
                    getattr(renderer, f"disable_{enable}_rendering")()
        target = np.zeros((120, 160, 3), np.uint8)
        assert ours.render(out=target) is target and np.array_equal(target, own_picture(own, data))


def own_picture(own, data):
    own.update_scene(data, camera="eye")
    return own.render()


RAW = {"bayer_mosaic": {"pattern": "RGGB"}, "quantization": {"bits": 12}, "read_noise": {"sigma": 0.01}}
LAYOUTS = {
    "uint8": ((96, 128, 3), np.uint8),
    "uint16": ((96, 128, 3), np.uint16),
    "float32": ((96, 128, 3), np.float32),
    "raw12": ((96, 128), np.uint16),
    "mipi12": ((96, 192), np.uint8),
}


@pytest.mark.parametrize("output", LAYOUTS)
def test_an_output_has_the_bits_of_the_camera_called_directly(model, handed, output):
    data, cam = mujoco.MjData(model), Camera(128, 96, fovy=50, readout_time_s=0.02, seed=5, effects=RAW)
    truth.place(model, data, truth.pan, 0.1)
    shape, dtype = LAYOUTS[output]
    with sm.Renderer(model, 96, 128, camera=cam, output=output) as renderer:
        renderer.update_scene(data, "eye")
        seen = renderer.render()
        ((used, rgb, given),) = handed
        alone = Camera._of_text(used.toml, "camera", {"seed": 5})
        assert (seen.shape, seen.dtype) == (shape, dtype)
        assert seen.tobytes() == alone(rgb, **{**given, "output": output}).tobytes()
        # Controls: the next frame has other noise, and the camera another seed.
        assert seen.tobytes() != renderer.render().tobytes()
        assert seen.tobytes() != alone(rgb, **{**given, "output": output, "seed": 6}).tobytes()


def test_outputs_are_written_where_one_wants_them(model):
    data, cam = mujoco.MjData(model), Camera(128, 96, fovy=50, effects=RAW, seed=5)
    truth.place(model, data, truth.pan, 0.1)
    with sm.Renderer(model, 96, 128, camera=cam, output=(np.uint16, "raw12")) as renderer:
        renderer.update_scene(data, "eye")
        with renderer.submit() as frame:
            wide, raw = frame.result(), frame.read("raw12")
        assert wide.shape == (96, 128, 3) and raw.shape == (96, 128) and raw.max() <= 4095
        for kind in (np.uint16, np.float64):
            renderer.next_frame, out = 0, np.zeros((96, 128, 3), kind)
            assert renderer.render(out=out) is out and np.array_equal(out, wide)
    with pytest.raises(errors.ArgumentError, match="raw11"):
        sm.Renderer(model, 96, 128, camera=cam, output="raw11")
    with pytest.raises(errors.ArgumentError, match="126"):
        sm.Renderer(model, 96, 126, camera=cam, output="mipi10")
    with sm.Renderer(model, 96, 128, camera=camera(), output="raw10") as renderer:
        renderer.update_scene(data, "eye")
        with pytest.raises(errors.InputError, match="bayer_mosaic"):
            renderer.render()


FALLING = """<mujoco><option timestep="0.001"/><visual><quality shadowsize="0"/></visual><worldbody><light pos="0 0 4"/>
<geom type="plane" size="5 5 .1"/><camera name="eye" pos="0 -3 1" xyaxes="1 0 0 0 .2 1"/>
<body pos="0 0 1.2"><freejoint/><geom type="box" size=".3 .3 .3" rgba="1 .5 .2 1"/></body></worldbody></mujoco>"""


def test_physics_is_stepped_as_mujoco_does(device):
    model = mujoco.MjModel.from_xml_string(FALLING)
    ours, theirs = mujoco.MjData(model), mujoco.MjData(model)
    with sm.Renderer(model, 96, 128, camera=Camera(128, 96, fovy=45, readout_time_s=0.02)) as renderer:
        renderer.step(ours, 250)
        mujoco.mj_step(model, theirs, nstep=250)
        assert np.array_equal(ours.qpos, theirs.qpos)
        renderer.update_scene(ours, "eye")
        falling = renderer.render()
        # After a reset the world has rested: the same as a camera without a shutter sees.
        mujoco.mj_resetData(model, ours)
        renderer.update_scene(ours, "eye")
        rested = renderer.render()
    with sm.Renderer(model, 96, 128, camera=Camera(128, 96, fovy=45)) as still:
        still.update_scene(ours, "eye")
        assert np.abs(still.render().astype(int) - rested).max() <= 1
    assert not np.array_equal(falling, rested)


def test_wrong_use_is_refused(model):
    with pytest.raises(errors.ArgumentError, match="pictures"):
        sm.Renderer(model, 48, 64, camera=camera(), pictures=9)
    with sm.Renderer(model, 48, 64, camera=camera()) as renderer:
        with pytest.raises(RuntimeError, match="update_scene"):
            renderer.render()
        with pytest.raises(ValueError, match="nobody"):
            renderer.update_scene(mujoco.MjData(model), "nobody")
    with pytest.raises(RuntimeError, match="close"):
        renderer.render()
    assert (model.vis.global_.offwidth, model.vis.global_.offheight) == (640, 480)
