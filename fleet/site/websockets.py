"""The URLs of WebSockets."""

from __future__ import annotations

from typing import Any

from django.urls import path, re_path

from teleop.camera.camera_consumer import CameraConsumer
from teleop.foxglove.consumer import FoxgloveConsumer
from teleop.live.consumers.bookings_consumer import BookingsConsumer
from teleop.live.consumers.fleet_consumer import FleetConsumer
from teleop.live.consumers.message_socket import no_such_address
from teleop.live.consumers.news_consumer import NewsConsumer
from teleop.live.consumers.robot_consumer import RobotConsumer
from teleop.live.consumers.topics_consumer import TopicsConsumer
from teleop.rosbridge.consumer import RosbridgeConsumer

# Typed as Any, because the types of `path` allow only HTTP views.
fleet_page: Any = FleetConsumer.as_asgi()
calendar: Any = BookingsConsumer.as_asgi()
news: Any = NewsConsumer.as_asgi()
robot_page: Any = RobotConsumer.as_asgi()
robot_topics: Any = TopicsConsumer.as_asgi()
robot_cameras: Any = CameraConsumer.as_asgi()
foxglove: Any = FoxgloveConsumer.as_asgi()
rosbridge: Any = RosbridgeConsumer.as_asgi()
elsewhere: Any = no_such_address

websocket_urlpatterns = [
    path("ws/fleet/", fleet_page),
    path("ws/bookings/", calendar),
    path("ws/news/", news),
    path("ws/robots/<slug:slug>/", robot_page),
    path("ws/robots/<slug:slug>/topics/", robot_topics),
    path("ws/robots/<slug:slug>/camera/", robot_cameras),
    # Doors of programs (`fleet.site.websocket_handshake`)
    path("foxglove/<slug:slug>", foxglove),
    path("foxglove/<slug:slug>/", foxglove),
    path("rosbridge/<slug:slug>", rosbridge),
    path("rosbridge/<slug:slug>/", rosbridge),
    re_path("", elsewhere),
]
