"""A viewer of video gets each picture after a key picture; after damage it waits for the next key picture."""

from robots.shared.wire import CameraWatch
from teleop.camera.feed import CameraViewer, _Newest


async def sent(_camera, _event):
    return True


async def test_video_after_a_damaged_picture_begins_with_a_key():
    viewer = CameraViewer(CameraWatch("head", video=True), sent, lambda _state: None)
    viewer.quality.variant = "video"

    async def offered(made, key=False):
        newest = _Newest(made, made, key, {})
        taken = viewer.is_due(newest, 0.0)
        if taken:
            await viewer.show(newest, 0.0)
            viewer.acknowledge(made, damaged=made == 3)
        return taken

    assert [await offered(made, key=made == 1) for made in (1, 2, 3, 4)] == [True, True, True, False]
    assert viewer.needs_key
    assert await offered(5, key=True)
    assert await offered(6)
