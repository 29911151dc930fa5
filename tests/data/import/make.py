"""Makes the recordings beside it, with writers that are not ours: pip install rosbags mcap numpy; python make.py.

One camera of 16x12 px on a base that drives and turns, three frames; values of pixel (x, y), channel c, frame k are
(7 x + 13 y + 50 c + 29 k) mod 256. tests/cli/import.rs holds what comes out against that.
"""

import base64
import json
import math
import shutil
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as Bag1
from rosbags.rosbag2 import Writer as Bag2
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

HERE = Path(__file__).parent
WIDTH, HEIGHT, FRAMES = 16, 12, 3
START = 1_700_000_000_000_000_000


def picture(k):
    y, x, c = np.mgrid[0:HEIGHT, 0:WIDTH, 0:3]
    return ((7 * x + 13 * y + 50 * c + 29 * k) % 256).astype(np.uint8)


def messages(store, ros1):
    types = store.types
    vector, point, quaternion = (types[f"geometry_msgs/msg/{n}"] for n in ("Vector3", "Point", "Quaternion"))

    def header(ns, frame):
        stamp = types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
        return types["std_msgs/msg/Header"](**({"seq": 7} if ros1 else {}), stamp=stamp, frame_id=frame)

    def turn(yaw):
        return quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))

    def link(ns, parent, child, place, rotation):
        transform = types["geometry_msgs/msg/Transform"](translation=vector(*place), rotation=rotation)
        return types["geometry_msgs/msg/TransformStamped"](header(ns, parent), child, transform)

    tree = types["tf2_msgs/msg/TFMessage"]
    optical = quaternion(x=-0.5, y=0.5, z=-0.5, w=0.5)
    yield START, "/tf_static", "tf2_msgs/msg/TFMessage", tree([link(START, "base", "optical", (0.1, 0.0, 0.2), optical)])
    for i in range(-1, 8):
        ns = START + i * 20_000_000
        yield ns, "/tf", "tf2_msgs/msg/TFMessage", tree([link(ns, "map", "base", (0.1 * i, 0.0, 0.0), turn(0.05 * i))])
        spin, gravity = vector(0.0, 0.0, 2.5), vector(0.0, 0.0, 9.8)
        still, free = turn(0.0), np.zeros(9)
        yield ns, "/imu", "sensor_msgs/msg/Imu", types["sensor_msgs/msg/Imu"](
            header(ns, "base"), still, free, spin, free, gravity, free
        )
        where = types["geometry_msgs/msg/Pose"](point(0.1 * i, 0.0, 0.0), turn(0.05 * i))
        speed = types["geometry_msgs/msg/Twist"](vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
        yield ns, "/odom", "nav_msgs/msg/Odometry", types["nav_msgs/msg/Odometry"](
            header(ns, "map"),
            "base",
            types["geometry_msgs/msg/PoseWithCovariance"](where, np.zeros(36)),
            types["geometry_msgs/msg/TwistWithCovariance"](speed, np.zeros(36)),
        )
        if i % 2 or not 0 <= i < 2 * FRAMES:
            continue
        data = np.ascontiguousarray(picture(i // 2)[..., ::-1]).reshape(-1)
        at = header(ns + 3, "optical")
        yield ns + 10**6, "/cam/image_raw", "sensor_msgs/msg/Image", types["sensor_msgs/msg/Image"](
            at, HEIGHT, WIDTH, "bgr8", 0, WIDTH * 3, data
        )
        k, p = [15.0, 0, 7.5, 0, 15.0, 5.5, 0, 0, 1.0], [15.0, 0, 7.5, 0, 0, 15.0, 5.5, 0, 0, 0, 1.0, 0]
        part = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        lens = np.array([-0.1, 0.01, 0, 0, 0])
        yield ns + 10**6, "/cam/camera_info", "sensor_msgs/msg/CameraInfo", types["sensor_msgs/msg/CameraInfo"](
            at, HEIGHT, WIDTH, "plumb_bob", lens, np.array(k), np.eye(3).reshape(-1), np.array(p), 0, 0, part
        )


def write(bag, store, ros1):
    with bag:
        topics = {}
        for ns, topic, kind, message in messages(store, ros1):
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=store)
            bag.write(topics[topic], ns, (store.serialize_ros1 if ros1 else store.serialize_cdr)(message, kind))


def ros1():
    store = get_typestore(Stores.ROS1_NOETIC)
    if "tf2_msgs/msg/TFMessage" not in store.types:
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    for name, packing in (("plain", None), ("bz2", Bag1.CompressionFormat.BZ2), ("lz4", Bag1.CompressionFormat.LZ4)):
        path = HERE / f"ros1_{name}.bag"
        path.unlink(missing_ok=True)
        bag = Bag1(path)
        if packing:
            bag.set_compression(packing)
        write(bag, store, True)


def ros2():
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, packed in (("plain", False), ("messages_zstd", True)):
        folder = HERE / "part"
        bag = Bag2(folder, version=8, storage_plugin=StoragePlugin.SQLITE3)
        if packed:
            bag.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
        write(bag, store, False)
        shutil.move(folder / "part.db3", HERE / f"ros2_{name}.db3")
        shutil.rmtree(folder)
    for packing in (CompressionType.LZ4, CompressionType.ZSTD):
        with (HERE / f"ros2_{packing.name.lower()}.mcap").open("wb") as file:
            writer = Writer(file, compression=packing, chunk_size=4000)
            writer.start("ros2", "make.py")
            topics = {}
            for ns, topic, kind, message in messages(store, False):
                if topic not in topics:
                    schema = writer.register_schema(kind, "ros2msg", b"")
                    topics[topic] = writer.register_channel(topic, "cdr", schema)
                writer.add_message(topics[topic], ns, bytes(store.serialize_cdr(message, kind)), ns)
            writer.finish()


def foxglove():
    with (HERE / "foxglove_json.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("", "make.py")
        schema = writer.register_schema("foxglove.RawImage", "jsonschema", b"{}")
        topic = writer.register_channel("/raw", "json", schema)
        for k in range(FRAMES):
            ns = START + k * 40_000_000 + 3
            stamp = {"sec": ns // 10**9, "nsec": ns % 10**9}
            data = base64.b64encode(picture(k).tobytes()).decode()
            about = {"width": WIDTH, "height": HEIGHT, "step": WIDTH * 3, "encoding": "rgb8"}
            writer.add_message(topic, ns, json.dumps({"timestamp": stamp, "frame_id": "cam", **about, "data": data}).encode(), ns)
        writer.finish()


ros1()
ros2()
foxglove()
