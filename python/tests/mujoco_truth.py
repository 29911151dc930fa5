"""MuJoCo rendered row by row, each at its own time: what a rolling shutter sees, without any of our code."""

import mujoco
import numpy as np

WIDTH, HEIGHT, READOUT_S, STEP_S = 320, 240, 0.03, 0.002

MODEL = """
<mujoco>
  <option timestep="0.002"/>
  <visual><global offwidth="640" offheight="480"/><quality shadowsize="0"/><map znear="0.01" zfar="30"/></visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1=".6 .7 .9" rgb2=".2 .3 .5" width="256" height="256"/>
    <texture name="floor" type="2d" builtin="checker" rgb1=".3 .3 .35" rgb2=".6 .6 .55" width="256" height="256"/>
    <texture name="wood" type="2d" builtin="flat" mark="random" random="0.02" rgb1=".6 .4 .3" markrgb=".7 .5 .4"
      width="256" height="256"/>
    <material name="floor" texture="floor" texrepeat="10 10"/>
    <material name="wood" texture="wood" texrepeat="1 1"/>
  </asset>
  <worldbody>
    <light pos="0 -2 4" dir="0 .4 -1"/>
    <geom type="plane" size="8 8 .1" material="floor"/>
    <geom type="box" size="4 .1 1.5" pos="0 4 1.5" material="wood"/>
    <geom type="cylinder" size=".25 .6" pos="-1.2 1.5 .6" rgba=".8 .3 .2 1"/>
    <geom type="sphere" size=".4" pos="1.1 2.2 .4" rgba=".2 .5 .8 1"/>
    <body name="mover" mocap="true" pos="0 1 .5"><geom type="box" size=".3 .3 .3" material="wood"/>
      <geom type="capsule" size=".06 .3" pos="0 0 .5" rgba=".9 .8 .1 1"/></body>
    <body name="rig" mocap="true" pos="0 -1.5 1"><camera name="eye" xyaxes="1 0 0 0 .15 1" fovy="50"/></body>
  </worldbody>
</mujoco>
"""


def turned(axis, angle):
    """A quaternion, w first."""
    quaternion = np.zeros(4)
    mujoco.mju_axisAngle2Quat(quaternion, np.asarray(axis, float), angle)
    return quaternion


def pan(t):
    """170 degrees a second."""
    return [(0, 1, 0.5), turned((0, 0, 1), 0.3)], [(0, -1.5, 1), turned((0, 0, 1), 3.0 * (t - 0.1))]


def walk(t):
    """Steps: nods, sways, bobs, and goes ahead."""
    phase = 2 * np.pi * 1.8 * (t + 0.35)
    place = (0.03 * np.sin(phase / 2), -1.5 + 1.3 * (t - 0.1), 1 + 0.025 * np.sin(phase))
    turn = turned((1, 0.3, 0.5), 0.08 * np.sin(phase + 1))
    return [(0, 1, 0.5), turned((0, 0, 1), 0.3)], [place, turn]


def vibration(t):
    phase = 2 * np.pi * 25 * t
    turn = turned((0.3, 0.6, 1), 0.02 * np.sin(phase))
    return [(0, 1, 0.5), turned((0, 0, 1), 0.3)], [
        (0.002 * np.sin(phase), -1.5, 1 + 0.002 * np.cos(phase)),
        turn,
    ]


def moving_body(t):
    s = t - 0.1
    return [(3.0 * s, 1, 0.5 + 1.0 * s), turned((0, 0, 1), 0.3 + 10 * s)], [
        (0, -1.5, 1),
        turned((0, 0, 1), 0),
    ]


def place(model, data, motion, t):
    """The state of a time, with all that follows from it."""
    for i, (position, turn) in enumerate(motion(t)):
        data.mocap_pos[i], data.mocap_quat[i] = position, turn
    data.time = t
    mujoco.mj_forward(model, data)


def of_rows(model, motion, time_s, exposures=(0.0,), rows=None):
    """What a camera sees whose row i is taken at `time_s` + readout i/N, the mean over `exposures` after that."""
    data = mujoco.MjData(model)
    picture = np.zeros((HEIGHT, WIDTH, 3))
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        for row in range(HEIGHT) if rows is None else rows:
            for exposure in exposures:
                place(model, data, motion, time_s + READOUT_S * row / HEIGHT + exposure)
                renderer.update_scene(data, camera="eye")
                picture[row] += linear(renderer.render()[row]) / len(exposures)
    return picture


def linear(byte):
    value = np.asarray(byte) / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def srgb(value):
    return np.where(value <= 0.0031308, value * 12.92, 1.055 * np.maximum(value, 1e-9) ** (1 / 2.4) - 0.055) * 255


def psnr(a, b):
    """In dB, of encoded values."""
    return 10 * np.log10(255**2 / np.mean((np.asarray(a, float) - np.asarray(b, float)) ** 2))
