"""`shutterbug bag` on a bag that rosbags wrote, read back by rosbags: neither is what the package reads and writes with."""

import numpy as np
import pytest

import shutterbug
from shutterbug import Camera, errors

import oracle

for name in ("mcap", "mcap_ros2", "rosbags"):
    pytest.importorskip(name, reason=f"{name} is not installed")

from rosbags.rosbag2 import Reader, StoragePlugin, Writer  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

from shutterbug import bag  # noqa: E402

pytestmark = pytest.mark.usefixtures("device")
STORE = get_typestore(Stores.ROS2_HUMBLE)
RATE, READOUT, START = 1.2, 0.03, 1_700_000_000.25


def kind(name):
    return STORE.types[name]


def stamp(time_s):
    whole = int(time_s)
    return kind("builtin_interfaces/msg/Time")(sec=whole, nanosec=round((time_s - whole) * 1e9))


def header(time_s, frame):
    return kind("std_msgs/msg/Header")(stamp=stamp(time_s), frame_id=frame)


def link(time_s, parent, child, turn, place=(0.0, 0.0, 0.0)):
    vector, quaternion = kind("geometry_msgs/msg/Vector3"), kind("geometry_msgs/msg/Quaternion")
    x, y, z, w = (float(v) for v in turn)
    move = kind("geometry_msgs/msg/Transform")(translation=vector(*place), rotation=quaternion(x=x, y=y, z=z, w=w))
    stamped = kind("geometry_msgs/msg/TransformStamped")(header=header(time_s, parent), child_frame_id=child, transform=move)
    return kind("tf2_msgs/msg/TFMessage")(transforms=[stamped])


def image(time_s, array, encoding, pad=0):
    height, row = array.shape[0], array[0].nbytes
    data = np.zeros((height, row + pad), np.uint8)
    data[:, :row] = np.ascontiguousarray(array).view(np.uint8).reshape(height, row)
    fields = {"height": height, "width": array.shape[1], "encoding": encoding, "is_bigendian": 0, "step": row + pad}
    return kind("sensor_msgs/msg/Image")(header=header(time_s, "optical"), data=data.reshape(-1), **fields)


def camera_info():
    k = np.array([100.0, 0, 63.5, 0, 100, 47.5, 0, 0, 1])
    roi = kind("sensor_msgs/msg/RegionOfInterest")(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    rest = {"d": np.zeros(5), "k": k, "r": np.eye(3).ravel(), "p": np.zeros(12), "binning_x": 0, "binning_y": 0, "roi": roi}
    return kind("sensor_msgs/msg/CameraInfo")(header=header(START, "optical"), height=96, width=128, distortion_model="plumb_bob", **rest)


@pytest.fixture
def recorded(tmp_path, picture):
    """A body that turns to the left about z (up) at RATE, a camera on it, and four pictures of a far wall."""
    folder = tmp_path / "bag"
    optical = (-0.5, 0.5, -0.5, 0.5)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {"/tf": "tf2_msgs/msg/TFMessage", "/tf_static": "tf2_msgs/msg/TFMessage", "/eye/camera_info": "sensor_msgs/msg/CameraInfo"}
        topics |= {"/eye/image": "sensor_msgs/msg/Image", "/eye/depth": "sensor_msgs/msg/Image", "/said": "std_msgs/msg/String"}
        to = {topic: writer.add_connection(topic, name, typestore=STORE) for topic, name in topics.items()}

        def write(topic, time_s, message):
            writer.write(to[topic], round(time_s * 1e9), STORE.serialize_cdr(message, topics[topic]))

        write("/tf_static", START, link(START, "base", "optical", optical, (0.1, 0.0, 0.2)))
        write("/eye/camera_info", START, camera_info())
        write("/said", START, kind("std_msgs/msg/String")(data="hello"))
        for i in range(21):
            t = START + 0.01 * i
            half = RATE * 0.01 * i / 2
            write("/tf", t, link(t, "world", "base", (0, 0, np.sin(half), np.cos(half))))
        for i, t in enumerate(START + np.array([0.0, 0.05, 0.1, 0.15])):
            write("/eye/image", t, image(t, picture[..., ::-1], "bgr8", pad=4))
            if i != 3:
                write("/eye/depth", t, image(t, np.full((96, 128), 50_000, np.uint16), "16UC1"))
    return next(folder.glob("*.mcap"))


def read_back(file, topic):
    with Reader(file.parent) as reader:
        wanted = [c for c in reader.connections if c.topic == topic]
        return [STORE.deserialize_cdr(raw, c.msgtype) for c, _, raw in reader.messages(connections=wanted)]


def moved_to_its_own_folder(file, recorded, tmp_path):
    """rosbags reads folders with a metadata.yaml: that of the source fits, for what was copied."""
    folder = tmp_path / "read"
    folder.mkdir()
    (folder / "metadata.yaml").write_text((recorded.parent / "metadata.yaml").read_text())
    return file.rename(folder / recorded.name)


def test_images_are_those_of_a_camera_that_turns(recorded, tmp_path, picture):
    cam = Camera(128, 96, fovy=50, readout_time_s=READOUT)
    out = tmp_path / "out.mcap"
    done = bag.rewrite(recorded, out, cam, image="/eye/image", depth="/eye/depth")
    # The first picture's frame begins before tf does, the last has no depth.
    assert done.frames == 2 and len(done.left_out) == 2
    assert "tf of base" in done.left_out[0] and "no depth" in done.left_out[1]
    out = moved_to_its_own_folder(out, recorded, tmp_path)
    images = read_back(out, "/eye/image")
    assert [m.header.stamp.nanosec for m in images] == pytest.approx([300_000_000, 350_000_000], abs=500)
    # To the left about z, up, is against our turn about y, down.
    k = np.array([[100.0, 0, 64], [0, 100, 48], [0, 0, 1]])
    truth = oracle.rolling(picture, k, (96, 128), (0, 0), -RATE, READOUT, READOUT / 2)
    wrong = oracle.rolling(picture, k, (96, 128), (0, 0), RATE, READOUT, READOUT / 2)
    for message in images:
        assert (message.encoding, message.step) == ("bgr8", 128 * 3 + 4)
        seen = message.data.reshape(96, -1)[:, : 128 * 3].reshape(96, 128, 3)[..., ::-1]
        assert oracle.psnr(seen[:, 8:-8], truth[:, 8:-8]) > 36
        assert oracle.psnr(seen[:, 8:-8], wrong[:, 8:-8]) < 28
    # All else is as it was.
    for topic in ("/tf", "/tf_static", "/said", "/eye/depth", "/eye/camera_info"):
        assert repr(read_back(out, topic)) == repr(read_back(recorded, topic))


def test_the_program_does_the_same(recorded, tmp_path, monkeypatch, capsys):
    from shutterbug.__main__ import main

    Camera(128, 96, fovy=50, readout_time_s=READOUT).save(tmp_path / "camera.toml")
    words = ["bag", str(recorded), str(tmp_path / "a.mcap"), "--camera", str(tmp_path / "camera.toml"), "--image", "/eye/image"]
    monkeypatch.setattr("sys.argv", ["shutterbug", *words, "--depth", "/eye/depth"])
    assert main() == 0 and "2 frames rewritten" in capsys.readouterr().err
    bag.rewrite(recorded, tmp_path / "b.mcap", Camera.from_toml(tmp_path / "camera.toml"), image="/eye/image", depth="/eye/depth")
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
    monkeypatch.setattr("sys.argv", ["shutterbug", *words, "--depth", "/nothing"])
    assert main() == 1 and "/nothing" in capsys.readouterr().err


def test_wrong_bags_are_refused_and_leave_no_file(recorded, tmp_path):
    cam, out = Camera(128, 96, fovy=50, readout_time_s=READOUT), tmp_path / "out.mcap"
    topics = {"image": "/eye/image", "depth": "/eye/depth"}
    wrong = [{"image": "/none"}, {"depth": "/none"}, {"info": "/none"}]
    for change in [*wrong, {"depth": "/eye/image"}, {"image": "/eye/depth"}, {"world": "moon"}]:
        with pytest.raises(errors.InputError):
            bag.rewrite(recorded, out, cam, **{**topics, **({"info": "/eye/camera_info"} | change)})
        assert not out.exists() and not list(tmp_path.glob("*.part"))
    with pytest.raises(errors.ArgumentError):
        bag.rewrite(recorded, recorded, cam, **topics)
    with pytest.raises(FileNotFoundError):
        bag.rewrite(tmp_path / "none.mcap", out, cam, **topics)
    assert shutterbug.errors is errors
