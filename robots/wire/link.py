"""Messages of the link: web process to bridge, and back."""

from __future__ import annotations

from typing import Annotated, Literal
from uuid import UUID

import msgspec
from msgspec import Meta, Struct

from robots.wire.base import Fence, Refusal, SampleRate, Seq, Share, ShortText, TopicName
from robots.wire.page import Drive, Refresh
from robots.wire.state import State, StopState
from robots.wire.tasks import TaskRequest
from robots.wire.topics import TopicQuery


class LinkHello(Struct, frozen=True, tag_field="t", tag="link_hello"):
    """First on a link. `web` names the process, for logs and for people."""

    protocol: int
    web: ShortText


class Grant(Struct, frozen=True, tag_field="t", tag="grant"):
    """Control for `seconds` from arrival, by the bridge's own clock; repeated to renew.

    The bridge refuses a fence below the highest it has ever seen, and the same number under another
    control session.
    """

    fence: Fence
    seconds: Annotated[float, Meta(gt=0.0, le=60.0)]
    session: ShortText
    holder: ShortText
    holder_id: ShortText
    max_share: Share
    delay_s: Annotated[float, Meta(ge=0.0)] | None = None  # web process -> holder's page -> web process
    silent_s: Annotated[float, Meta(ge=0.0)] | None = None  # since its last message; None: it sends no stream
    # age of the camera picture by which the holder drives; None: not by a camera
    camera_s: Annotated[float, Meta(ge=0.0)] | None = None


class Revoke(Struct, frozen=True, tag_field="t", tag="revoke"):
    """Control under `fence` ends now."""

    fence: Fence
    reason: ShortText


class Pause(Struct, frozen=True, tag_field="t", tag="pause"):
    """The holder's page is gone: zero at once, stick to neutral before it moves again."""

    fence: Fence
    reason: ShortText


class LinkStop(Struct, frozen=True, tag_field="t", tag="link_stop", omit_defaults=True):
    """Emergency stop. May be the first message of a link; `seq` and `press` come back with the answer.

    `robot` is the robot that is meant (None: the robot of the bridge that hears it); the bridge of another robot
    refuses it. `press` names the press: the same press that arrives twice stops once.
    """

    by: ShortText
    reason: ShortText = ""
    seq: Seq = 0
    robot: UUID | None = None
    press: UUID | None = None
    waited: bool = (
        False  # it was pending: since when the robot should stand, the one who hears it does not know
    )


class LinkLate(Struct, frozen=True, tag_field="t", tag="link_late"):
    """The web process's loop woke so late: commands lay unread there."""

    late_s: Annotated[float, Meta(ge=0.0)]


class LinkClear(Struct, frozen=True, tag_field="t", tag="link_clear"):
    """Clear the latch of stop `number`. The web process has checked the right. `seq` comes back with the answer.

    `presses` are older presses that were never confirmed: if they arrive later, they do not stop again.
    """

    by: ShortText
    number: Seq
    seq: Seq = 0
    presses: Annotated[list[UUID], Meta(max_length=10)] = []


class LinkCancel(Struct, frozen=True, tag_field="t", tag="link_cancel"):
    """Cancel a task of this console, for a person without control. The web process has checked the right."""

    what: Literal["motion", "speech"]
    by: ShortText
    seq: Seq = 0


class LinkQuery(Struct, frozen=True, tag_field="t", tag="inspect"):
    """A `TopicQuery` about the robot's topics. `seq` comes back with the answer."""

    seq: Seq
    ask: TopicQuery


class LinkSubscribe(Struct, frozen=True, tag_field="t", tag="subscribed"):
    """All topics that are subscribed through this web process, with the highest rate that is wanted."""

    topics: dict[TopicName, SampleRate]


class LinkCamera(Struct, frozen=True, tag_field="t", tag="link_camera"):
    """People watch cameras through this web process, or do no more. While somebody does, `CameraAt` follows."""

    wanted: bool


class LinkState(Struct, frozen=True, tag_field="t", tag="link_state"):
    """Asks for one `Status` now. A link without a hello may ask."""


class Viewers(Struct, frozen=True, tag_field="t", tag="watch"):
    """People who view the robot through this web process, and how many `more`. Without viewers: `Status`, no views.

    `joints`: one of them draws the robot in 3D: views have its joints, and heights.
    """

    watchers: Annotated[list[ShortText], Meta(max_length=20)]
    more: Annotated[int, Meta(ge=0)] = 0
    joints: bool = False


LinkRequest = (
    LinkHello
    | LinkState
    | Grant
    | Revoke
    | Pause
    | Drive
    | TaskRequest
    | Refresh
    | LinkCancel
    | LinkStop
    | LinkLate
    | LinkClear
    | Viewers
    | LinkQuery
    | LinkSubscribe
    | LinkCamera
)


class BridgeFigures(Struct, frozen=True):
    """Counts of a bridge since it was started."""

    decisions: list[
        int
    ]  # drive messages by the time from reading one to its twist, as `robots.processes.durations`
    decisions_s: float  # of all of them together
    interventions: int  # of the gate, as the log counts them


class BridgeHello(Struct, frozen=True, omit_defaults=True, tag_field="t", tag="bridge_hello"):
    """First from a bridge. `fence` is the highest number it has seen. `Status` and `Offers` follow a `LinkHello`."""

    protocol: int
    robot: str  # UUID
    slug: str
    fence: int
    figures: BridgeFigures | None = None


class LaneToken(Struct, frozen=True, tag_field="t", tag="lane"):
    """Next to this link's socket is a lane (`robots.link.lane`); its first datagram is this token."""

    token: str


class Granted(Struct, frozen=True, tag_field="t", tag="granted"):
    """A grant was taken (also answers each renewal)."""

    fence: int


class Ended(Struct, frozen=True, tag_field="t", tag="ended"):
    """Control under `fence` ended at the bridge."""

    fence: int


class Status(Struct, frozen=True, tag_field="t", tag="status"):
    """The state without a view, twice a second and on change, also without viewers."""

    state: State


class Stopped(Struct, frozen=True, tag_field="t", tag="stopped", omit_defaults=True):
    """Answer to a stop or clear, `seq` and `press` as there: the latch as it is now."""

    stop: StopState
    seq: int = 0
    press: UUID | None = None


class LinkAnswer(Struct, frozen=True, tag_field="t", tag="inspected"):
    """The answer to `LinkQuery`."""

    seq: int
    answer: msgspec.Raw  # a `TopicAnswer`, handed on untouched


class LinkSample(Struct, frozen=True, tag_field="t", tag="link_sample"):
    """The newest message of a topic that is subscribed."""

    topic: str
    sample: msgspec.Raw  # a `Sample`, handed on untouched


class CameraAt(Struct, frozen=True, tag_field="t", tag="camera_at"):
    """Address of the robot's camera process: a Unix socket, or a TCP port of the bridge's host.

    Both None: there is none, because it starts, or because of `refusal`.
    """

    unix_path: str | None = None
    port: int | None = None
    refusal: Refusal | None = None
