"""One decoder for each direction: it accepts only the messages of that direction."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from robots.shared.wire.base import Accepted, Ack, BridgeGone, Notice, Ping, Pong, Refused
from robots.shared.wire.camera import CameraMessage, CameraPong, CameraRequest, Cameras, CameraState
from robots.shared.wire.codec import MessageDecoder
from robots.shared.wire.link import (
    BridgeHello,
    CameraAt,
    Ended,
    Granted,
    LaneToken,
    LinkAnswer,
    LinkRequest,
    LinkSample,
    Status,
    Stopped,
)
from robots.shared.wire.navigation import GoPath
from robots.shared.wire.page import (
    Ask,
    AskCancel,
    BookingsChanged,
    CameraView,
    Clear,
    ClearRobot,
    Control,
    Drive,
    Fleet,
    HandOver,
    Hello,
    Refresh,
    Release,
    Renew,
    ShowJoints,
    Stop,
    StopAll,
    StopRobot,
    Take,
    TakeOver,
    Welcome,
)
from robots.shared.wire.state import Offers, View
from robots.shared.wire.tasks import TaskRequest
from robots.shared.wire.topics import Sample, TopicAnswer, TopicsMessage

BrowserMessage = (
    Hello
    | Take
    | TakeOver
    | Renew
    | Release
    | Ask
    | AskCancel
    | HandOver
    | Drive
    | CameraView
    | ShowJoints
    | TaskRequest
    | Refresh
    | Stop
    | Clear
    | Ack
    | Ping
)
FleetMessage = StopRobot | StopAll | ClearRobot | Ack | Ping
BrowserReport = Welcome | Control | Notice | Accepted | Refused | BridgeGone | Offers | GoPath | View | Pong
TopicsReport = TopicAnswer | Sample | BridgeGone | Notice | Pong
CameraReport = Cameras | CameraState | CameraPong | BridgeGone | Notice | Refused
FleetReport = Fleet | Refused | Pong
BookingsReport = BookingsChanged | Refused | Pong
LinkReport = (
    BridgeHello
    | LaneToken
    | Granted
    | Ended
    | Status
    | Stopped
    | Accepted
    | Refused
    | Offers
    | GoPath
    | LinkAnswer
    | LinkSample
    | CameraAt
)
browser_message = MessageDecoder[BrowserMessage](BrowserMessage)
topics_message = MessageDecoder[TopicsMessage](TopicsMessage)
camera_message = MessageDecoder[CameraMessage](CameraMessage)
camera_request = MessageDecoder[CameraRequest](CameraRequest)
fleet_message = MessageDecoder[FleetMessage](FleetMessage)
link_request = MessageDecoder[LinkRequest](LinkRequest)
# Reports have no size limit; an invalid report raises `msgspec.DecodeError`.
browser_report: Callable[[str | bytes], BrowserReport] = msgspec.json.Decoder(BrowserReport).decode
topics_report: Callable[[str | bytes], TopicsReport] = msgspec.json.Decoder(TopicsReport).decode
link_report: Callable[[str | bytes], LinkReport] = msgspec.json.Decoder(LinkReport).decode  # text frames
