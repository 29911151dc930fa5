"""ROS 2 without ROS: the images of an MCAP file as a real camera would have delivered them.

    shutterbug bag IN.mcap OUT.mcap --camera camera.toml --image /camera/image_raw --depth /camera/depth

Images are rewritten with the depth of the same stamp and the camera's way through tf. All else is copied as it is.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ._arrays import Array
from ._transforms_tree import Tree
from .camera import Camera
from .errors import ArgumentError, InputError, ShutterbugError, TimeRangeError

# They state no types that checkers know.
_reader: Any = importlib.import_module("mcap.reader")
_writer: Any = importlib.import_module("mcap.writer")
_ros2: Any = importlib.import_module("mcap_ros2.decoder")

__all__ = ["Rewritten", "main", "rewrite"]

_COLORS = {"rgb8": (3, False), "bgr8": (3, True), "rgba8": (4, False), "bgra8": (4, True)}
# Stamps of depth and image that belong together differ by less, s.
_SAME_S = 1e-3


@dataclass
class Rewritten:
    """What `rewrite` did: `frames`, the number of those that were rewritten, and `left_out` with the reason of each."""

    frames: int = 0
    left_out: list[str] = field(default_factory=list)


def rewrite(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    camera: Camera,
    *,
    image: str,
    depth: str,
    info: str | None = None,
    frame: str | None = None,
    world: str | None = None,
) -> Rewritten:
    """Rewrite the images of `source`, a ROS 2 bag in MCAP, into `target`, another file.

    `camera`: its effects and times are used; size and pinhole are those of the topic `info` (None: ``camera_info`` beside `image`).
    `image`, `depth`: topics of sensor_msgs/msg/Image: rgb8, bgr8, rgba8 or bgra8; and 32FC1 in m or 16UC1 in mm. `frame`: the
    camera's optical frame in tf (None: that of the images' headers). `world`: the frame that rests (None: the root of tf).

    A stamp is taken for the instant that the picture shows, and becomes the middle of the frame. Nothing is known of what lies beyond the
    picture: its border is repeated there. Frames without depth, or that tf does not cover, are left out, and `Rewritten` says why.
    ArgumentError: `source` and `target` are one file. InputError: a topic is missing or holds something else. OSError where a file cannot
    be read or written; a failed run leaves no file.
    """
    target = Path(target)
    if target.exists() and os.path.samefile(source, target):
        raise ArgumentError("the bag would be written over itself: another file is expected")
    known = _read(source, image, depth, info or image.rsplit("/", 1)[0] + "/camera_info")
    part = target.with_name(target.name + ".part")
    try:
        with part.open("wb") as to, known.camera(camera) as fitted:
            done = _write(source, to, fitted, known, image, (frame, world))
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)
    return done


@dataclass
class _Known:
    """What one reading of the bag tells."""

    tree: Tree
    depths: dict[int, Array]
    matrix: tuple[int, int, Any] | None

    def camera(self, camera: Camera) -> Camera:
        if self.matrix is None:
            raise InputError("there is no CameraInfo with a pinhole: name its topic")
        width, height, k = self.matrix
        # Pixel centres are at whole numbers there.
        return camera.with_pinhole(width, height, fx=k[0], fy=k[4], cx=k[2] + 0.5, cy=k[5] + 0.5)


def _seconds(stamp: Any) -> float:
    return float(stamp.sec) + float(stamp.nanosec) * 1e-9


def _messages(source: str | os.PathLike[str], topics: list[str]) -> Any:
    with Path(source).open("rb") as file:
        reader = _reader.make_reader(file, decoder_factories=[_ros2.DecoderFactory()])
        yield from reader.iter_decoded_messages(topics=topics)


def _read(source: str | os.PathLike[str], image: str, depth: str, info: str) -> _Known:
    known = _Known(Tree(), {}, None)
    for _, channel, _, message in _messages(source, ["/tf", "/tf_static", depth, info]):
        if channel.topic in ("/tf", "/tf_static"):
            for link in message.transforms:
                p, q = link.transform.translation, link.transform.rotation
                place = (link.header.frame_id.lstrip("/"), link.child_frame_id.lstrip("/"), _seconds(link.header.stamp))
                known.tree.add(*place, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w), channel.topic == "/tf_static")
        elif channel.topic == depth:
            known.depths[round(_seconds(message.header.stamp) / _SAME_S)] = _depth_of(message)
        else:
            known.matrix = (message.width, message.height, list(message.k))
    known.tree.finish()
    if not known.depths:
        raise InputError(f"{os.fspath(source)}: there is no message on {depth}: a topic of depth images is expected")
    return known


def _rows(message: Any, dtype: Any, channels: int) -> Array:
    ordered = np.dtype(dtype).newbyteorder(">" if message.is_bigendian else "<")
    row = message.width * channels * ordered.itemsize
    data = np.frombuffer(bytes(message.data), np.uint8)
    if message.step < row or len(data) < message.step * message.height:
        raise InputError(f"an image of {message.width}x{message.height} px in {message.encoding} has {len(data)} bytes")
    rows: Array = data[: message.step * message.height].reshape(message.height, message.step)[:, :row]
    pixels: Array = np.ascontiguousarray(rows).view(ordered)
    return pixels.reshape(int(message.height), int(message.width), channels)


def _depth_of(message: Any) -> Array:
    if message.encoding == "32FC1":
        metres = _rows(message, np.float32, 1)[..., 0].astype(np.float32)
    elif message.encoding in ("16UC1", "mono16"):
        metres = _rows(message, np.uint16, 1)[..., 0].astype(np.float32) * np.float32(1e-3)
    else:
        raise InputError(f"depth is {message.encoding}: 32FC1 (m) or 16UC1 (mm) is expected")
    return np.where(metres > 0, metres, np.float32(np.inf))


def _write(
    source: str | os.PathLike[str], to: Any, camera: Camera, known: _Known, image: str, frames: tuple[str | None, str | None]
) -> Rewritten:
    done = Rewritten()
    writer = _writer.Writer(to)
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    decoders = _ros2.DecoderFactory()
    with Path(source).open("rb") as file:
        reader = _reader.make_reader(file, decoder_factories=[decoders])
        header = reader.get_header()
        writer.start(profile=header.profile, library=header.library)
        for schema, channel, message in reader.iter_messages():
            data = message.data
            if channel.topic == image:
                decode = decoders.decoder_for(channel.message_encoding, schema)
                if decode is None:
                    raise InputError(f"{image}: {channel.message_encoding} of {schema and schema.encoding}: CDR of ros2msg is expected")
                decoded = decode(data)
                number = done.frames + len(done.left_out)
                try:
                    picture = _deliver(decoded, camera, known, number, frames)
                except (TimeRangeError, _NoDepthError) as reason:
                    done.left_out.append(str(reason))
                    continue
                data = _with_pixels(data, decoded, picture)
                done.frames += 1
            if schema is not None and schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in channels:
                kind = schemas[schema.id] if schema is not None else 0
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, kind, channel.metadata)
            stamps = (message.log_time, data, message.publish_time, message.sequence)
            writer.add_message(channels[channel.id], *stamps)
    writer.finish()
    if not done.frames and not done.left_out:
        raise InputError(f"{os.fspath(source)}: there is no message on {image}: a topic of images is expected")
    return done


def _with_pixels(data: bytes, message: Any, picture: Array) -> bytes:
    """The message with other pixels: they are its last field, and as many as before."""
    before = bytes(message.data)
    if not data.endswith(before):
        raise InputError("an image's pixels are not the end of its message")
    row = picture.shape[1] * picture.shape[2]
    pixels = np.frombuffer(before, np.uint8).copy()
    rows = pixels[: message.step * message.height].reshape(message.height, message.step)
    rows[:, :row] = picture.reshape(message.height, row)
    return data[: len(data) - len(before)] + pixels.tobytes()


class _NoDepthError(ShutterbugError):
    """An image has no depth of its stamp."""


def _deliver(message: Any, camera: Camera, known: _Known, number: int, frames: tuple[str | None, str | None]) -> Array:
    if message.encoding not in _COLORS:
        raise InputError(f"an image is {message.encoding}: one of {', '.join(_COLORS)} is expected")
    channels, swapped = _COLORS[message.encoding]
    rgb = _rows(message, np.uint8, channels)
    order = [2, 1, 0, 3][:channels] if swapped else list(range(channels))
    shown = _seconds(message.header.stamp)
    depth = known.depths.get(round(shown / _SAME_S))
    if depth is None:
        raise _NoDepthError(f"the image of {shown:.4f} s has no depth of its stamp")
    optical = frames[0] or message.header.frame_id.lstrip("/")
    world = frames[1] or known.tree.root(optical)
    if world not in (known.tree.root(optical), *known.tree.chain(optical)):
        raise InputError(f"tf: {optical} does not hang on {world}")
    # Times of its own, from the middle on: seconds since 1970 leave few digits.
    start = -camera.middle(0.0)
    begin, end = camera.span(start)
    times = known.tree.stamps(optical, shown + min(begin, 0.0) - 1e-4, shown + max(end, 0.0) + 1e-4)
    at_rest = [np.linalg.inv(known.tree.pose(world, t)) for t in times]
    poses = np.array([r @ known.tree.pose(optical, t) for r, t in zip(at_rest, times, strict=True)])
    given = {"depth": depth, "poses": (np.array(times) - shown, poses), "time": start, "color_time": 0.0}
    made: Array = camera(np.ascontiguousarray(rgb[..., order]), frame=number, border="repeat", **given)  # type: ignore[arg-type]
    return np.ascontiguousarray(made[..., order])


def main(words: list[str] | None = None) -> int:
    """Run ``shutterbug bag`` with `words` (None: the process' own); exit codes as of all commands: 0 done, 1 input or machine at fault
    (with a sentence on stderr). SystemExit with the code 2: usage.
    """
    parser = argparse.ArgumentParser(
        "shutterbug bag", description="Rewrites the images of a ROS 2 bag (MCAP) as a camera would deliver them."
    )
    parser.add_argument("source", metavar="IN.mcap")
    parser.add_argument("target", metavar="OUT.mcap")
    chosen = parser.add_mutually_exclusive_group(required=True)
    chosen.add_argument("--camera", metavar="FILE", help="a camera.toml")
    chosen.add_argument("--preset", metavar="NAME", help="a preset")
    parser.add_argument("--image", required=True, metavar="TOPIC", help="sensor_msgs/msg/Image: rgb8, bgr8, rgba8, bgra8")
    parser.add_argument("--depth", required=True, metavar="TOPIC", help="sensor_msgs/msg/Image: 32FC1 (m), 16UC1 (mm)")
    parser.add_argument("--info", metavar="TOPIC", help="default: camera_info beside the images")
    parser.add_argument("--frame", metavar="NAME", help="the optical frame in tf; default: of the images' headers")
    parser.add_argument("--world", metavar="NAME", help="the frame that rests; default: the root of tf")
    parser.add_argument("--seed", type=int, default=0)
    a = parser.parse_args(words)
    try:
        camera = Camera.from_toml(a.camera, seed=a.seed) if a.camera else Camera.preset(a.preset, seed=a.seed)
        topics = {"image": a.image, "depth": a.depth, "info": a.info, "frame": a.frame, "world": a.world}
        done = rewrite(a.source, a.target, camera, **topics)
    except (ShutterbugError, OSError) as error:
        print(f"shutterbug: error: {error}", file=sys.stderr)
        return 1
    for reason in done.left_out:
        print(f"left out: {reason}", file=sys.stderr)
    print(f"{done.frames} frames rewritten, {len(done.left_out)} left out", file=sys.stderr)
    return 0
