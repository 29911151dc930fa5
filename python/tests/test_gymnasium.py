"""`shutterbug.gymnasium` with the real gymnasium and MuJoCo."""

import numpy as np
import pytest

from shutterbug import Camera, errors

import needs

needs.mujoco()
gymnasium = pytest.importorskip("gymnasium", reason="gymnasium is not installed")
pytest.importorskip("imageio", reason="gymnasium[mujoco] is not installed")

import shutterbug.gymnasium as sg  # noqa: E402

pytestmark = pytest.mark.usefixtures("device")
SIZE = {"height": 72, "width": 96}
CAM = Camera.preset("usb-webcam")


def episode(seed, cam=CAM, steps=4, env_seed=5):
    env = sg.CameraWrapper(gymnasium.make("Ant-v5"), cam, **SIZE)
    first, _ = env.reset(seed=seed)
    env.action_space.seed(env_seed)
    seen = [first["pixels"]]
    for _ in range(steps):
        observation, *_ = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation)
        seen.append(observation["pixels"])
    env.close()
    return np.stack(seen)


def test_same_seed_same_bits():
    first = episode(3)
    assert np.array_equal(episode(3), first)
    assert not np.array_equal(episode(4), first)


def test_what_happens_between_observations_is_in_the_picture():
    """The frame skip's own steps bend the picture: with the states of observations alone it is another one."""
    cam = Camera(96, 72, fovy=45, readout_time_s=0.045, frame_period_s=0.05)
    env = sg.CameraWrapper(gymnasium.make("Ant-v5"), cam, **SIZE)
    env.reset(seed=1)
    times = []
    for _ in range(3):
        env.step(env.action_space.sample())
        times = list(env.renderer._history._times)
    assert np.allclose(np.diff(times), env.unwrapped.model.opt.timestep)
    assert env.renderer.frame_time_s == pytest.approx(env.unwrapped.data.time - 0.045)
    env.close()


def test_the_wrapped_environment_is_the_same():
    plain, wrapped = gymnasium.make("Ant-v5"), sg.CameraWrapper(gymnasium.make("Ant-v5"), CAM, **SIZE)
    a, _ = plain.reset(seed=2)
    b, _ = wrapped.reset(seed=2)
    plain.action_space.seed(0)
    for _ in range(3):
        action = plain.action_space.sample()
        a, reward_a, *_ = plain.step(action)
        b, reward_b, *_ = wrapped.step(action)
        assert np.array_equal(a, b["state"]) and reward_a == reward_b
    wrapped.close()
    plain.close()


def test_vectors_share_a_device_and_see_what_each_alone_sees():
    cam = Camera(96, 72, fovy=45, readout_time_s=0.02)
    alone = [episode(seed, cam, steps=0)[0] for seed in (1, 2, 3, 4, 5)]
    env = sg.CameraVectorWrapper(gymnasium.vector.SyncVectorEnv([lambda: gymnasium.make("Ant-v5")] * 5), cam, **SIZE)
    observation, _ = env.reset(seed=[1, 2, 3, 4, 5])
    assert observation["pixels"].shape == (5, 72, 96, 3) and env.observation_space.contains(observation)
    assert all(np.array_equal(a, b) for a, b in zip(alone, observation["pixels"], strict=True))
    observation, *_ = env.step(env.action_space.sample())
    assert len({id(e.renderer.camera) for e in env._eyes}) == 1
    env.close()


RAW = Camera(96, 72, fovy=45, readout_time_s=0.02, effects={"bayer_mosaic": {"pattern": "RGGB"}, "quantization": {"bits": 12}})


@pytest.mark.parametrize("output", ["uint8", "uint16", "float32", "raw12", "mipi12"])
def test_an_output_is_in_the_observation_and_its_space(handed, output):
    env = sg.CameraWrapper(gymnasium.make("Ant-v5"), RAW, **SIZE, output=output)
    observation, _ = env.reset(seed=1)
    observation, *_ = env.step(env.action_space.sample())
    pixels, box = observation["pixels"], env.observation_space["pixels"]
    assert env.observation_space.contains(observation) and (pixels.dtype, pixels.shape) == (box.dtype, box.shape)
    highest = {"uint16": 65535, "float32": 1, "raw12": 4095}.get(output, 255)
    assert (box.low == 0).all() and (box.high == highest).all()
    used, rgb, given = handed[-1]
    alone = used.with_effects({})
    assert pixels.tobytes() == alone(rgb, **{**given, "output": output}).tobytes()
    # The control: a picture with white in it reaches the bound of the space, so that a lower one would refuse it.
    white = alone(np.full_like(rgb, 255), **{**given, "output": output})
    assert white.max() == highest and box.contains(white) and not box.contains(pixels.astype(np.float64))
    env.close()


def test_outputs_of_vectors():
    env = sg.CameraVectorWrapper(gymnasium.vector.SyncVectorEnv([lambda: gymnasium.make("Ant-v5")] * 3), RAW, **SIZE, output="raw12")
    observation, _ = env.reset(seed=[1, 2, 3])
    assert observation["pixels"].shape == (3, 72, 96) and observation["pixels"].dtype == np.uint16
    assert env.observation_space.contains(observation) and observation["pixels"].max() > 255
    env.close()


def test_others_are_refused():
    with pytest.raises(errors.ArgumentError, match="one of them"):
        sg.CameraWrapper(gymnasium.make("Ant-v5"), RAW, output=("uint8", "raw12"))
    with pytest.raises(errors.ArgumentError, match="MuJoCo"):
        sg.CameraWrapper(gymnasium.make("CartPole-v1"), CAM)
