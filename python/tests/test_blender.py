"""`shutterbug.blender.Renderer` against Blender itself, one row at a time."""

import tempfile
from pathlib import Path

import numpy as np
import pytest

from shutterbug import Camera, errors
from shutterbug._exr import read_exr

bpy = pytest.importorskip("bpy", reason="bpy is not installed (Python 3.11 alone, 350 MB)")
sb = pytest.importorskip("shutterbug.blender")

pytestmark = pytest.mark.usefixtures("device")
WIDTH, HEIGHT, READOUT, START = 160, 120, 0.03, 0.1
ROWS = range(4, HEIGHT, 10)


def checkers(name, scale):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    waves, light, out = (nodes.new(f"ShaderNode{kind}") for kind in ("TexNoise", "Emission", "OutputMaterial"))
    waves.inputs["Scale"].default_value = scale
    links.new(waves.outputs["Color"], light.inputs["Color"])
    links.new(light.outputs[0], out.inputs[0])
    return material


def animate(thing, way):
    """A key each hundredth of a second."""
    for frame in range(0, 26):
        thing.location, thing.rotation_euler = way(frame / 100)
        thing.keyframe_insert("location", frame=frame)
        thing.keyframe_insert("rotation_euler", frame=frame)


def scene_of(eye_way, cube_way):
    import addon_utils

    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon_utils.enable("cycles")
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 64, False
    scene.render.fps, scene.render.resolution_x, scene.render.resolution_y = 100, WIDTH, HEIGHT
    bpy.ops.mesh.primitive_plane_add(size=20, location=(0, 6, 0), rotation=(np.pi / 2, 0, 0))
    bpy.context.object.data.materials.append(checkers("wall", 30))
    bpy.ops.mesh.primitive_cube_add(size=0.8, location=(0, 2, 0))
    cube = bpy.context.object
    cube.data.materials.append(checkers("cube", 6))
    animate(cube, cube_way)
    scene.camera = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    scene.collection.objects.link(scene.camera)
    animate(scene.camera, eye_way)
    return scene


def eye_at_rest(t):
    return (0, -1, 0), (np.pi / 2, 0, 0)


def cube_at_rest(t):
    return (0.2, 2, 0), (0, 0, 0.4)


MOTIONS = {
    "pan": (lambda t: ((0, -1, 0), (np.pi / 2, 0, 2.5 * (t - START))), cube_at_rest, 34),
    "moving body": (eye_at_rest, lambda t: ((3 * (t - START), 2, (t - START)), (0, 0, 0.4 + 8 * t)), 34),
}


def truth(scene):
    """Each row alone, at its own time."""
    out, render = np.zeros((len(ROWS), WIDTH, 3)), scene.render
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR", "32", "NONE"
    render.use_border, render.use_crop_to_border = True, False
    render.border_min_x, render.border_max_x = 0, 1
    for i, row in enumerate(ROWS):
        frame = (START + READOUT * row / HEIGHT) * 100
        scene.frame_set(int(frame), subframe=frame - int(frame))
        render.border_min_y, render.border_max_y = 1 - (row + 1) / HEIGHT, 1 - row / HEIGHT
        with tempfile.TemporaryDirectory() as folder:
            render.filepath = str(Path(folder) / "row.exr")
            bpy.ops.render.render(write_still=True)
            planes = read_exr(next(Path(folder).iterdir()))
        out[i] = np.stack([planes[c][row] for c in "RGB"], axis=-1)
    render.use_border = False
    return np.where(out <= 0.0031308, out * 12.92, 1.055 * np.maximum(out, 1e-9) ** (1 / 2.4) - 0.055) * 255


def psnr(a, b):
    return 10 * np.log10(255**2 / np.mean((np.asarray(a, float) - b) ** 2))


@pytest.mark.parametrize("name", MOTIONS)
def test_rolling_shutter_is_that_of_rows_rendered_one_by_one(name):
    eye_way, cube_way, goal = MOTIONS[name]
    scene = scene_of(eye_way, cube_way)
    rows = truth(scene)
    before = (scene.render.resolution_x, scene.camera.data.sensor_width, scene.render.image_settings.file_format)
    with sb.Renderer(scene, Camera(8, 8, fovy=50, readout_time_s=READOUT)) as eye:
        one = psnr(eye.render(START)[ROWS], rows)
    assert (scene.render.resolution_x, scene.camera.data.sensor_width, scene.render.image_settings.file_format) == before
    with sb.Renderer(scene, Camera(8, 8, fovy=50)) as still:
        own = psnr(still.render(START + READOUT / 2)[ROWS], rows)
    print(f"{name}: one picture {one:.1f} dB, without a shutter {own:.1f} dB")
    assert one >= goal and own < one - 6


@pytest.mark.parametrize(("output", "dtype"), [("uint16", np.uint16), ("float32", np.float32), ("raw12", np.uint16)])
def test_an_output_has_the_bits_of_the_camera_called_directly(handed, output, dtype):
    scene = scene_of(*MOTIONS["pan"][:2])
    scene.cycles.samples = 4
    effects = {"bayer_mosaic": {"pattern": "RGGB"}, "quantization": {"bits": 12}, "read_noise": {"sigma": 0.01}}
    cam = Camera(8, 8, fovy=50, readout_time_s=READOUT, seed=5, effects=effects)
    with sb.Renderer(scene, cam, output=output) as eye:
        seen = eye.render(START)
    used, rgb, given = handed[-1]
    alone = used.with_effects({})
    assert seen.dtype == dtype and seen.shape[:2] == (HEIGHT, WIDTH)
    assert seen.tobytes() == alone(rgb, **{**given, "output": output}).tobytes()
    assert seen.tobytes() != alone(rgb, **{**given, "output": output, "frame": 7}).tobytes(), "control: other noise"


def test_wrong_use_is_refused(tmp_path):
    scene = scene_of(eye_at_rest, cube_at_rest)
    for options in ({"pictures": 9}, {"poses": 1}):
        with pytest.raises(errors.ArgumentError, match="pictures"):
            sb.Renderer(scene, Camera(8, 8, fovy=50), **options)
    scene.camera.data.type = "ORTHO"
    with pytest.raises(errors.ArgumentError, match="perspective"):
        sb.Renderer(scene, Camera(8, 8, fovy=50))
    for content in (b"", b"v/1\x01", b"\x76\x2f\x31\x01\x02\0\0\0\0"):
        (tmp_path / "x.exr").write_bytes(content)
        with pytest.raises((errors.InputError, errors.ShutterbugError)):
            read_exr(tmp_path / "x.exr")
