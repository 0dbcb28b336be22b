"""One decoder for each direction: it accepts only the messages of that direction."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from robots.shared.wire import fleet, page
from robots.shared.wire.base import Accepted, Ack, BridgeGone, Notice, Ping, Pong, Refused
from robots.shared.wire.codec import MessageDecoder
from robots.shared.wire.links import bridge
from robots.shared.wire.links.camera import CameraMessage, CameraPong, CameraRequest, Cameras, CameraState
from robots.shared.wire.links.shelf import ShelfRead
from robots.shared.wire.links.tap import TapWants
from robots.shared.wire.navigation import GoPath
from robots.shared.wire.state import Offers, View
from robots.shared.wire.tasks import TaskRequest
from robots.shared.wire.topics import Sample, TopicAnswer, TopicsMessage

BrowserMessage = (
    page.Hello
    | page.Take
    | page.TakeOver
    | page.Renew
    | page.Release
    | page.Ask
    | page.AskCancel
    | page.HandOver
    | page.Drive
    | page.CameraView
    | page.ShowJoints
    | TaskRequest
    | page.Refresh
    | page.RecordingRequest
    | page.Stop
    | page.Clear
    | Ack
    | Ping
)
FleetMessage = page.StopRobot | page.StopAll | page.ClearRobot | Ack | Ping
BrowserReport = (
    page.Welcome | page.Control | Notice | Accepted | Refused | BridgeGone | Offers | GoPath | View | Pong
)
TopicsReport = TopicAnswer | Sample | BridgeGone | Notice | Pong
CameraReport = Cameras | CameraState | CameraPong | BridgeGone | Notice | Refused
FleetReport = fleet.Fleet | fleet.Beat | Refused | Pong
BookingsReport = page.BookingsChanged | Refused | Pong
NewsReport = page.News | Refused | Pong
LinkReport = (
    bridge.BridgeHello
    | bridge.LaneToken
    | bridge.Granted
    | bridge.Ended
    | bridge.Status
    | bridge.Stopped
    | Accepted
    | Refused
    | Offers
    | GoPath
    | bridge.LinkAnswer
    | bridge.LinkSample
    | bridge.ProcessAt
)
browser_message = MessageDecoder[BrowserMessage](BrowserMessage)
topics_message = MessageDecoder[TopicsMessage](TopicsMessage)
camera_message = MessageDecoder[CameraMessage](CameraMessage)
camera_request = MessageDecoder[CameraRequest](CameraRequest)
tap_request = MessageDecoder[TapWants](TapWants, largest_bytes=256 * 1024)
shelf_request = MessageDecoder[ShelfRead](ShelfRead)
fleet_message = MessageDecoder[FleetMessage](FleetMessage)
link_request = MessageDecoder[bridge.LinkRequest](bridge.LinkRequest)
# Reports have no size limit; an invalid report raises `msgspec.DecodeError`.
browser_report: Callable[[str | bytes], BrowserReport] = msgspec.json.Decoder(BrowserReport).decode
topics_report: Callable[[str | bytes], TopicsReport] = msgspec.json.Decoder(TopicsReport).decode
link_report: Callable[[str | bytes], LinkReport] = msgspec.json.Decoder(LinkReport).decode  # text frames
