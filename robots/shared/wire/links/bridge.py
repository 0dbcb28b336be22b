"""Messages of the link: web process to bridge, and back."""

from __future__ import annotations

from typing import Annotated, Literal
from uuid import UUID

import msgspec
from msgspec import Meta, Struct

from robots.shared.wire.base import (
    Fence,
    Refusal,
    SampleRate,
    Seq,
    Share,
    ShortText,
    TopicName,
    Worded,
)
from robots.shared.wire.page import Drive, Refresh
from robots.shared.wire.recordings import LinkKeep, LinkRecord, LinkRecordEnd
from robots.shared.wire.state import MovesAlthoughStopped, State, StopState
from robots.shared.wire.tasks import Publish, TaskRequest
from robots.shared.wire.topics import DoorQuery, TopicQuery

ProcessName = Literal["camera", "tap", "shelf"]  # that serve web processes themselves


class LinkHello(Struct, frozen=True, tag_field="t", tag="link_hello"):
    """First message on a link. `web` names the web process, for logs and for people."""

    protocol: int
    web: ShortText


class Grant(Struct, frozen=True, tag_field="t", tag="grant"):
    """Give control for `seconds` from arrival, by the bridge's own clock. The web process repeats it to renew.

    The bridge refuses a fence below the highest fence that it has ever received, and the same fence with another
    control session.
    """

    fence: Fence
    seconds: Annotated[float, Meta(gt=0.0, le=60.0)]
    session: ShortText
    holder: ShortText
    holder_id: ShortText
    max_share: Share
    delay_s: Annotated[float, Meta(ge=0.0)] | None = None  # round trip to the holder's page
    # since the holder's last message; None: no stream of messages
    silent_s: Annotated[float, Meta(ge=0.0)] | None = None
    # age of the camera picture by which the holder drives; None: drives without a camera
    camera_s: Annotated[float, Meta(ge=0.0)] | None = None


class Revoke(Worded, frozen=True, tag_field="t", tag="revoke"):
    """Control under `fence` ends now."""

    SENTENCES = ("reason",)

    fence: Fence
    reason: ShortText


class Pause(Worded, frozen=True, tag_field="t", tag="pause"):
    """The holder's page is gone: the bridge sends zero at once, and needs neutral before the robot moves again."""

    SENTENCES = ("reason",)

    fence: Fence
    reason: ShortText


class LinkStop(Struct, frozen=True, tag_field="t", tag="link_stop", omit_defaults=True):
    """Emergency stop. May be the first message of a link; the answer repeats `seq` and `press`.

    `robot` is the robot to stop (None: the robot of the receiving bridge); the bridge of another robot refuses the
    stop. `press` identifies the press: a press that arrives twice stops once.
    """

    by: ShortText
    reason: ShortText = ""
    seq: Seq = 0
    robot: UUID | None = None
    press: UUID | None = None
    waited: bool = False  # the stop was pending: the receiver does not know the time of the press


class LinkVelocity(Struct, frozen=True, tag_field="t", tag="velocity"):
    """A velocity of a program that streams them. As a stick position, it is answered only if it is refused."""

    order: Publish


class LinkLate(Struct, frozen=True, tag_field="t", tag="link_late"):
    """The event loop of the web process woke `late_s` too late: commands waited there unread."""

    late_s: Annotated[float, Meta(ge=0.0)]


class LinkClear(Struct, frozen=True, tag_field="t", tag="link_clear"):
    """Clear the latch of stop `number`. The web process has checked the right. The answer repeats `seq`.

    `presses` are older presses without confirmation: if they arrive later, they do not stop the robot again.
    """

    by: ShortText
    number: Seq
    seq: Seq = 0
    presses: Annotated[list[UUID], Meta(max_length=10)] = []


class LinkCancel(Struct, frozen=True, tag_field="t", tag="link_cancel"):
    """Cancel a task of this console, for a person without control. The web process has checked the right."""

    what: ShortText  # name of a `TaskKind` that others may cancel
    by: ShortText
    seq: Seq = 0


class LinkQuery(Struct, frozen=True, tag_field="t", tag="inspect"):
    """A `TopicQuery` or `DoorQuery` about the robot's topics. The answer repeats `seq`."""

    seq: Seq
    ask: TopicQuery | DoorQuery


class LinkSubscribe(Struct, frozen=True, tag_field="t", tag="subscribed"):
    """All topics that are subscribed through this web process, each with its highest requested rate."""

    topics: dict[TopicName, SampleRate]


class LinkProcess(Struct, frozen=True, tag_field="t", tag="link_process"):
    """Whether this web process needs that process beside the bridge. While it does, the bridge sends `ProcessAt`."""

    process: ProcessName
    wanted: bool


class LinkState(Struct, frozen=True, tag_field="t", tag="link_state"):
    """Request one `Status` now; allowed before `LinkHello`."""


class Viewers(Struct, frozen=True, tag_field="t", tag="watch"):
    """People who view the robot through this web process, and the number of those without a name here (`more`).

    Without viewers the bridge sends `Status`, but no views. `joints`: a viewer draws the robot in 3D, so views have
    joints and heights.
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
    | LinkVelocity
    | TaskRequest
    | Refresh
    | LinkCancel
    | LinkStop
    | LinkLate
    | LinkClear
    | Viewers
    | LinkQuery
    | LinkSubscribe
    | LinkProcess
    | LinkRecord
    | LinkRecordEnd
    | LinkKeep
)


class BridgeFigures(Struct, frozen=True):
    """Counts of a bridge since its start."""

    # Drive messages by their time from reading to twist, in the steps of `robots.shared.processes.durations`
    decisions: list[int]
    decisions_s: float  # sum of these times
    interventions: int  # of the gate, counted as in the audit log


class BridgeHello(Struct, frozen=True, omit_defaults=True, tag_field="t", tag="bridge_hello"):
    """First message of a bridge. `fence` is the highest it has received. `Status` and `Offers` follow a `LinkHello`."""

    protocol: int
    robot: str  # UUID
    slug: str
    fence: int
    figures: BridgeFigures | None = None


class LaneToken(Struct, frozen=True, tag_field="t", tag="lane"):
    """Next to this link's socket is a lane (`robots.shared.link.lane`); the first datagram there is this token."""

    token: str


class Granted(Struct, frozen=True, tag_field="t", tag="granted"):
    """A grant was accepted; also the answer to each renewal."""

    fence: int


class Ended(Struct, frozen=True, tag_field="t", tag="ended"):
    """Control under `fence` ended at the bridge."""

    fence: int


class Status(Struct, frozen=True, tag_field="t", tag="status"):
    """The state without surroundings: sent twice a second and on change, also without viewers."""

    state: State


class Stopped(Struct, frozen=True, tag_field="t", tag="stopped", omit_defaults=True):
    """Answer to a stop or clear: the present state of the latch, with `seq` and `press` of the request."""

    stop: StopState
    seq: int = 0
    press: UUID | None = None
    moves_although_stopped: MovesAlthoughStopped | None = None  # at another press


class LinkAnswer(Struct, frozen=True, tag_field="t", tag="inspected"):
    """The answer to `LinkQuery`."""

    seq: int
    answer: msgspec.Raw  # a `TopicAnswer`, forwarded unchanged


class LinkSample(Struct, frozen=True, tag_field="t", tag="link_sample"):
    """The newest message of a topic that is subscribed."""

    topic: str
    sample: msgspec.Raw  # a `Sample`, forwarded unchanged


class ProcessAt(Struct, frozen=True, tag_field="t", tag="process_at"):
    """Addresses of a process beside the bridge: a Unix socket, and a TCP port if the bridge's host has an address.

    Both None: there is no such process; it starts now, or `refusal` has the reason.
    """

    process: ProcessName
    unix_path: str | None = None
    port: int | None = None
    refusal: Refusal | None = None
