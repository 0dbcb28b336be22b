"""Addresses of the WebSockets."""

from __future__ import annotations

from typing import Any

from django.urls import path

from teleop.consumers import RobotConsumer

robot_page: Any = RobotConsumer.as_asgi()  # Any: `path` is typed for HTTP views

websocket_urlpatterns = [path("ws/robots/<slug:slug>/", robot_page)]
