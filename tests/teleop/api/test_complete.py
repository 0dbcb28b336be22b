"""Everything that a page can do, a program can do: each message of a page has its operation, and stands in the docs."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, get_args

import pytest

from robots import wire
from script.stack.messages import openapi

DOCS = Path(__file__).parents[3] / "docs" / "api.md"
ROBOT = "/robots/{slug}"
OPERATIONS: dict[type, tuple[str, str]] = {
    wire.Take: ("post", f"{ROBOT}/control"),
    wire.TakeOver: ("post", f"{ROBOT}/control"),
    wire.Release: ("delete", f"{ROBOT}/control"),
    wire.Renew: ("post", f"{ROBOT}/control/renew"),
    wire.Ask: ("post", f"{ROBOT}/control/line"),
    wire.AskCancel: ("delete", f"{ROBOT}/control/line"),
    wire.HandOver: ("post", f"{ROBOT}/control/hand-over"),
    wire.Drive: ("post", f"{ROBOT}/velocity"),
    wire.DriveBy: ("post", f"{ROBOT}/drive-by"),
    wire.DriveByCancel: ("delete", f"{ROBOT}/drive-by"),
    wire.LookAhead: ("post", f"{ROBOT}/look-ahead"),
    wire.Forget: ("post", f"{ROBOT}/forget"),
    wire.Play: ("post", f"{ROBOT}/motions/{{name}}"),
    wire.PlayCancel: ("delete", f"{ROBOT}/motion"),
    wire.Say: ("post", f"{ROBOT}/speech"),
    wire.SayCancel: ("delete", f"{ROBOT}/speech"),
    wire.Choose: ("put", f"{ROBOT}/inputs/{{use}}"),
    wire.Publish: ("post", f"{ROBOT}/topics/publish"),
    wire.PublishStop: ("delete", f"{ROBOT}/topics/publish"),
    wire.Stop: ("post", f"{ROBOT}/stop"),
    wire.Clear: ("post", f"{ROBOT}/stop/clear"),
    wire.ListTopics: ("get", f"{ROBOT}/topics"),
    wire.Describe: ("get", f"{ROBOT}/topics/definition"),
    wire.Subscribe: ("get", f"{ROBOT}/topics/message"),
    wire.DescribeService: ("get", f"{ROBOT}/services/definition"),
    wire.CallService: ("post", f"{ROBOT}/services/call"),
    wire.ListParameters: ("get", f"{ROBOT}/parameters"),
    wire.GetParameter: ("get", f"{ROBOT}/parameters/value"),
    wire.SetParameter: ("put", f"{ROBOT}/parameters/value"),
    wire.StopAll: ("post", "/stop"),
    wire.StopRobot: ("post", f"{ROBOT}/stop"),
    wire.ClearRobot: ("post", f"{ROBOT}/stop/clear"),
}
OF_THE_CONNECTION = {wire.Hello, wire.Ack, wire.Ping, wire.Refresh, wire.Unsubscribe}
MESSAGES = {*get_args(wire.BrowserMessage), *get_args(wire.TopicsMessage), *get_args(wire.FleetMessage)}


@pytest.fixture(scope="module")
def paths() -> Any:
    return json.loads(openapi())["paths"]


def test_each_message_of_a_page_has_an_operation(paths: Any) -> None:
    assert set(OPERATIONS) == MESSAGES - OF_THE_CONNECTION
    for message, (method, path) in OPERATIONS.items():
        assert method in paths.get(f"/api/v1{path}", {}), message


def test_each_operation_of_a_robot_stands_in_the_docs(paths: Any) -> None:
    text = DOCS.read_text().replace("…/", f"{ROBOT}/")
    named = set(re.findall(r"/[a-z][a-z{}/_-]*[a-z}]", text))
    missing = {path.removeprefix("/api/v1") for path in paths} - named
    assert not missing
