"""A camera process with a real rosmaster survives every bad picture, reports the reason, and goes on."""

from __future__ import annotations

import io
import resource
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import av
import msgspec
import numpy as np
import PIL.Image
import psutil
import pytest
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from robots.bridge.served.client import CAMERA
from robots.shared import wire
from robots.shared.configuration.bridge_config import CameraSource
from robots.simulator.cameras import encoding
from robots.simulator.cameras.lens import HEAD_LENS
from robots.simulator.faults import parse_faults
from robots.simulator.ros.side import RospySide
from robots.simulator.topics.cameras.messages import camera_info
from tests.processes import PATIENCE_S, until
from tests.ros.bridge_support import tiago_config
from tests.ros.support import Master
from tests.served import ServedProcess

COMPRESSED, RAW, INFO, ODD = "/cam/compressed", "/cam/raw", "/cam/info", "/cam/odd"
CAMERAS = [
    CameraSource("head", COMPRESSED, "sensor_msgs/CompressedImage", info=INFO, frame="eye"),
    CameraSource("raw", RAW, "sensor_msgs/Image"),
    CameraSource("odd", ODD, "sensor_msgs/CompressedImage"),
]
LITTLE_BYTES = 16 * 1024 * 1024  # less than a picture of 2300 x 2300 pixels and its copies
PIXELS = np.random.default_rng(0).integers(0, 256, (480, 640, 3), dtype=np.uint8)  # as JPEG 300 kB


class CameraProcess(ServedProcess):
    """One camera process, and a web process's connection to it."""

    def __init__(self, master: Master, folder: Path, errors: Path | None = None) -> None:
        self.pictures: deque[tuple[wire.TakenPicture, bytes]] = deque(maxlen=50)
        self.states: dict[str, wire.Refusal | None] = {}
        self.warnings: dict[str, wire.Refusal | None] = {}
        config = tiago_config(master, folder, topics={"cameras": CAMERAS})
        super().__init__(CAMERA, config, master.environment(), errors)

    def want(self, **cameras: str) -> None:
        """Ask for these variants of cameras: ``head="full"``."""
        self.say(wire.CameraWants({name: {variant: 30.0} for name, variant in cameras.items()}))

    def received(self, message: str | bytes) -> None:
        if isinstance(message, bytes):
            header, picture = wire.unpacked(message)
            self.pictures.append((header, bytes(picture)))
        else:
            state = msgspec.json.decode(message, type=wire.CameraState)
            self.states[state.camera], self.warnings[state.camera] = state.refusal, state.warning


@pytest.fixture(scope="module")
def camera(rosmaster, ros, tmp_path_factory) -> Iterator[CameraProcess]:
    process = CameraProcess(rosmaster, tmp_path_factory.mktemp("camera"))
    began = psutil.Process(process.process.pid).create_time()
    yield process
    assert psutil.Process(process.process.pid).create_time() == began, "no bad picture ended it"
    process.stop()


@pytest.fixture(scope="module")
def publish(camera, ros) -> Iterator[Callable[..., Any]]:
    """``publish(topic, message, condition, what)`` repeats a message until the condition is true; returns its value."""
    publishers: dict[str, rospy.Publisher] = {}

    def repeat(topic: str, message: Any, condition: Callable[[], Any], what: str) -> Any:
        if topic not in publishers:
            publishers[topic] = rospy.Publisher(topic, type(message), queue_size=1)

        def once_more() -> Any:
            if hasattr(message, "header"):
                message.header.stamp = rospy.Time.now()
            publishers[topic].publish(message)
            return condition()

        return until(once_more, what, 2 * PATIENCE_S)

    yield repeat
    for publisher in publishers.values():
        publisher.unregister()


def compressed(faults: str = "none", number: int = 0) -> CompressedImage:
    kind, data = encoding.compressed(PIXELS, number, parse_faults(faults))
    return CompressedImage(format=kind, data=data)


def raw(faults: str = "none", number: int = 0, **changes: Any) -> Image:
    fields = encoding.raw(PIXELS, number, parse_faults(faults))._asdict() | changes
    return Image(**fields)


def newest(camera: CameraProcess, name: str) -> wire.TakenPicture | None:
    return next((header for header, _ in reversed(camera.pictures) if header.camera == name), None)


def comes(camera: CameraProcess, publish: Callable[..., Any], name: str, message: Any) -> wire.TakenPicture:
    """Publish a good picture until the camera process sends it without a refusal."""
    camera.pictures.clear()
    topic = {source.name: source.topic for source in CAMERAS}[name]
    shown = publish(
        topic,
        message,
        lambda: camera.states.get(name, True) is None and newest(camera, name),
        f"a picture of {name}; said last: {camera.states}",
    )
    assert isinstance(shown, wire.TakenPicture)
    return shown


def is_refused(
    camera: CameraProcess, publish: Callable[..., Any], name: str, message: Any, words: str
) -> None:
    """Publish a bad picture until the camera's refusal contains these words."""
    topic = {source.name: source.topic for source in CAMERAS}[name]
    publish(
        topic,
        message,
        lambda: (refusal := camera.states.get(name)) is not None and words in refusal.text,
        f"{words!r}",
    )


@pytest.mark.parametrize(
    ("faults", "words"),
    [
        ("camera_truncated", "is cut off"),
        ("camera_zero", "is neither JPEG nor PNG"),
        ("camera_huge", "has 20000 x 20000 pixels"),
        ("camera_bomb", "has 20000 x 20000 pixels"),
    ],
)
def test_a_bad_compressed_picture_is_refused_in_words(camera, publish, faults, words):
    camera.want(head="full")
    comes(camera, publish, "head", compressed())
    is_refused(camera, publish, "head", compressed(faults), words)
    assert comes(camera, publish, "head", compressed()).format == "jpeg"


@pytest.mark.parametrize("variant", ["small", "video"])
def test_a_picture_that_cannot_be_decoded_is_refused(camera, publish, variant):
    camera.want(head=variant)
    comes(camera, publish, "head", compressed())
    is_refused(camera, publish, "head", compressed("camera_truncated"), "is cut off")
    broken = compressed("camera_encoding_changes", number=1)
    broken.data = broken.data[:200] + bytes(2000) + broken.data[2200:]
    is_refused(camera, publish, "head", broken, "cannot be decoded")
    comes(camera, publish, "head", compressed())


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (raw("camera_zero"), "has no pixels"),
        (raw("camera_huge"), "has 20000 x 20000 pixels"),
        (raw("camera_corrupt"), "need more"),
        (raw("camera_truncated"), "need more"),
        (raw(encoding="32FC3"), "which the console does not know"),
        (raw(height=1, width=10, step=2**32 - 1, encoding="mono16", data=bytes(20)), "need more"),
        (raw(height=479, step=1280, encoding="yuv422"), "has an odd side"),
    ],
    ids=("zero", "huge", "corrupt", "truncated", "encoding", "step", "odd"),
)
def test_a_bad_raw_picture_is_refused_in_words(camera, publish, message, words):
    camera.want(raw="full")
    comes(camera, publish, "raw", raw())
    is_refused(camera, publish, "raw", message, words)
    assert comes(camera, publish, "raw", raw()).format == "jpeg"


def test_a_picture_of_16_bits_is_alike_large_small_and_as_video(camera, publish):
    """Regression: it was white in small views and nearly black in large ones."""
    heat = np.linspace(29_000, 31_000, 640 * 480).reshape(480, 640).astype(np.uint16)
    written = io.BytesIO()
    PIL.Image.fromarray(heat).save(written, "PNG")
    message = CompressedImage(format="16UC1; png compressed ", data=written.getvalue())
    brightness = {}
    for variant in ("full", "small", "video"):
        camera.want(head=variant)
        header = comes(camera, publish, "head", message)
        assert (header.scale.low, header.scale.high) == (29_040, 30_960)
        encoded = next(
            data for shown, data in reversed(camera.pictures) if shown.variant == variant and shown.key
        )
        brightness[variant] = grey_of(encoded, variant).mean(axis=1)
    for rows in brightness.values():
        assert rows[: len(rows) // 20].mean() < 45 and rows[-len(rows) // 20 :].mean() > 230
        assert abs(rows.mean() - brightness["full"].mean()) < 6


def grey_of(encoded: bytes, variant: str) -> Any:
    if variant != "video":
        return np.asarray(PIL.Image.open(io.BytesIO(encoded)).convert("L"), float)
    decoder = av.CodecContext.create("h264", "r")
    [frame, *_] = [*decoder.decode(av.Packet(encoded)), *decoder.decode(None)]
    return frame.to_ndarray(format="gray").astype(float)


def test_a_topic_of_another_type_is_refused_in_words(camera, publish):
    camera.want(odd="full")
    is_refused(camera, publish, "odd", String("no picture"), "(std_msgs/String, not")


def test_a_changing_encoding_is_followed(camera, publish):
    camera.want(head="full", raw="full")
    for number, expected in enumerate(("jpeg", "png", "jpeg")):
        camera.pictures.clear()
        publish(
            COMPRESSED,
            compressed("camera_encoding_changes", number),
            lambda expected=expected: any(header.format == expected for header, _ in list(camera.pictures)),
            f"a picture as {expected}",
        )
    for number in range(3):
        header = comes(camera, publish, "raw", raw("camera_encoding_changes", number))
        assert (header.width, header.height) == (640, 480)


def test_a_changing_size_begins_a_new_video(camera, publish):
    camera.want(head="video")
    comes(camera, publish, "head", compressed())
    written = io.BytesIO()
    PIL.Image.fromarray(PIXELS[:120, :160]).save(written, "JPEG")
    smaller = CompressedImage(format="jpeg", data=written.getvalue())
    publish(
        COMPRESSED,
        smaller,
        lambda: any(header.key and header.width == 160 for header, _ in list(camera.pictures)),
        "a key picture",
    )


def info(**changes: Any) -> CameraInfo:
    message = camera_info(RospySide(), HEAD_LENS)
    for name, value in changes.items():
        setattr(message, name, value)
    return message


@pytest.mark.parametrize(
    "wrong",
    [
        info(K=[0.0] * 9),
        info(K=[float("nan")] * 9),
        info(K=[float("inf")] * 9),
        info(width=100, height=100),
        info(width=0, height=0),
        info(width=2**32 - 1, height=1),
    ],
    ids=("zeros", "nan", "infinite", "shape", "no size", "extreme"),
)
def test_pictures_come_without_a_lens_if_its_info_does_not_fit(camera, publish, wrong):
    camera.want(head="full")
    publish(INFO, info(), lambda: comes(camera, publish, "head", compressed()).lens, "a lens")
    publish(INFO, wrong, lambda: comes(camera, publish, "head", compressed()).lens is None, "no lens")


def transform(parent: str, child: str) -> TransformStamped:
    found = TransformStamped(child_frame_id=child)
    found.header.frame_id = parent
    found.header.stamp = rospy.Time.now()
    found.transform.rotation.w = 1.0
    return found


def test_pictures_come_without_a_pose_if_tf_is_missing_or_loops(camera, publish, ros):
    camera.want(head="full")
    publish(INFO, info(), lambda: comes(camera, publish, "head", compressed()).lens, "a lens")
    assert newest(camera, "head").pose is None, "no tf"

    def said(*transforms: TransformStamped) -> tuple[float, ...] | None:
        tf.publish(TFMessage(list(transforms)))
        return comes(camera, publish, "head", compressed()).pose

    with ros.speak("/tf", TFMessage) as tf:
        until(lambda: said(transform("base_footprint", "eye")), "a pose")
        until(lambda: said(transform("neck", "eye"), transform("eye", "neck")) is None, "no pose")
        until(lambda: said(transform("base_footprint", "eye")), "the pose again")


def test_words_say_why_nothing_is_drawn_into_pictures(camera, publish, ros):
    def warns(words: str) -> bool:
        comes(camera, publish, "head", compressed())
        return words in getattr(camera.warnings.get("head"), "text", "")

    def said(*transforms: TransformStamped) -> tuple[float, ...] | None:
        tf.publish(TFMessage(list(transforms)))
        return comes(camera, publish, "head", compressed()).pose

    camera.want(head="full")
    with ros.speak("/tf", TFMessage) as tf:
        small = "100 x 100 pixels, not 640 x 480"
        publish(INFO, info(width=100, height=100), lambda: warns(small), small)
        publish(INFO, info(), lambda: comes(camera, publish, "head", compressed()).lens, "a lens")
        until(lambda: said(transform("neck", "eye"), transform("eye", "neck")) is None, "no pose")
        until(lambda: warns("tf has no pose of"), "no place")
        until(lambda: said(transform("base_footprint", "eye")), "a pose")
        assert camera.warnings["head"] is None


def test_a_process_without_memory_ends_in_words(rosmaster, ros, publish, tmp_path):
    words = tmp_path / "words"
    hungry = CameraProcess(rosmaster, tmp_path, words)
    hungry.want(raw="full")
    comes(hungry, publish, "raw", raw())
    used = psutil.Process(hungry.process.pid).memory_info().data
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.prlimit(hungry.process.pid, resource.RLIMIT_DATA, (used + LITTLE_BYTES, hard))
    large = Image(width=2300, height=2300, encoding="rgb8", step=6900, data=bytes(6900 * 2300))
    publish(RAW, large, lambda: hungry.process.poll() is not None, "its end")
    hungry.stop(status=1)
    assert "the process ends" in words.read_text()
