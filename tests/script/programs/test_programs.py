"""Programs with tokens drive a robot through the real server: REST, and the WebSocket."""

from __future__ import annotations

import asyncio
import json
import math
import os
import re
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

import pytest
from jsonschema import Draft202012Validator
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect as websocket

from script.generate.messages import OPENAPI
from script.stack.client import Driver, sign_in
from script.stack.places import REPOSITORY
from script.stack.stack import PRACTICE_ROBOTS, Stack
from tests.script.support import manage, token

ROBOT = PRACTICE_ROBOTS[0].slug
ENDED_S = 3.0  # one second, and time for processes that start at the same time
T = TypeVar("T")
SCHEMA = json.loads(OPENAPI.read_text())
SCOPES = ("read", "drive", "speak", "motions")  # the scopes that docs/api.md uses


def require_documented(method: str, path: str, status: int, answer: Any) -> None:
    """Check an answer that is no refusal against the schema. schemathesis has no robot: it gets few such answers."""
    plain = f"/api/v1{path.partition('?')[0]}"
    fits = [one for one in SCHEMA["paths"] if re.fullmatch(re.sub(r"\{[^}]+\}", "[^/]+", one), plain)]
    operation = SCHEMA["paths"][min(fits, key=lambda one: one.count("{"))][method.lower()]
    content = operation["responses"][str(status)].get("content", {})
    if answer is None:
        assert content == {}
    else:
        schema = {"components": SCHEMA["components"], **content["application/json"]["schema"]}
        Draft202012Validator(schema).validate(answer)


class Api:
    """A program with a token."""

    def __init__(self, stack: Stack, token: str) -> None:
        self._stack, self.token = stack, token

    def __call__(self, method: str, path: str, body: Any = None, key: str = "") -> tuple[int, Any]:
        """Send a request, with `key` as its Idempotency-Key; return status and answer."""
        request = urllib.request.Request(  # noqa: S310
            f"{self._stack.url}/api/v1{path}",
            None if body is None else json.dumps(body).encode(),
            {
                "Authorization": f"Bearer {self.token}",
                "Content-Type": "application/json",
                **({"Idempotency-Key": key} if key else {}),
            },
            method=method,
        )
        try:
            with urllib.request.urlopen(request, timeout=45.0) as answer:  # noqa: S310
                raw = answer.read()
                found = json.loads(raw) if raw else None
                require_documented(method, path, answer.status, found)
                return answer.status, found
        except urllib.error.HTTPError as error:
            return error.code, json.loads(error.read())


def test_a_program_takes_control_drives_and_gives_it_back(stack: Stack) -> None:
    api = Api(stack, token(stack, "operator", "read", "drive"))
    control = f"/robots/{ROBOT}/control"
    assert api("GET", control) == (200, {**api("GET", control)[1], "state": "free"})
    status, refused = api("POST", f"/robots/{ROBOT}/velocity", {"forward_mps": 0.1})
    assert (status, refused["code"], refused["rule"]) == (409, "no_lease", "lease")

    status, taken = api("POST", control, {})
    assert (status, taken["state"]) == (200, "yours"), taken
    assert taken["fence"] > 0
    began = api("GET", f"/robots/{ROBOT}")[1]["state"]["odometry"]
    for _ in range(4):
        status, driven = api("POST", f"/robots/{ROBOT}/velocity", {"forward_mps": 0.2, "seconds": 0.5})
        assert status == 200, driven
    robot = api("GET", f"/robots/{ROBOT}")[1]
    ended = robot["state"]["odometry"]
    assert math.dist((ended["x"], ended["y"]), (began["x"], began["y"])) > 0.2
    assert "(night-tests)" in robot["holder"]
    status, refused = api("POST", f"/robots/{ROBOT}/velocity", {"forward_mps": 4.0})
    assert (status, refused["code"]) == (400, "too_fast")
    assert api("DELETE", control)[0] == 204
    assert api("GET", f"/robots/{ROBOT}")[1]["holder"] is None


def test_programs_keep_wait_for_hand_over_and_take_over_control(stack: Stack) -> None:
    one = Api(stack, token(stack, "operator", "read", "drive"))
    other = Api(stack, token(stack, "supervisor", "read", "drive"))
    control = f"/robots/{ROBOT}/control"
    assert one("POST", control, {})[1]["state"] == "yours"
    status, renewed = one("POST", f"{control}/renew")
    assert (status, renewed["state"]) == (200, "yours") and renewed["term_s"] > 800.0
    assert one("POST", f"/robots/{ROBOT}/look-ahead")[0] == 204
    assert one("POST", f"/robots/{ROBOT}/head", {"pan": 0.1, "tilt": -0.1})[0] == 204

    status, waits = other("POST", f"{control}/line")
    assert (status, waits["ahead"]) == (200, 0)
    [request] = until(lambda: one("GET", control)[1]["requests"])
    assert request["name"] == "Supervisor"
    assert one("POST", f"{control}/hand-over", {"number": request["number"]})[0] == 204
    assert until(lambda: other("GET", control)[1]["state"] == "yours")
    assert one("POST", f"{control}/line")[1]["ahead"] == 0
    assert one("DELETE", f"{control}/line")[0] == 204
    assert other("DELETE", control)[0] == 204

    assert one("POST", control, {})[1]["state"] == "yours"
    status, refused = other("POST", control, {})
    assert (status, refused["code"]) == (409, "held")
    assert other("POST", control, {"reason": "fire drill"})[1]["state"] == "yours"
    assert until(lambda: one("GET", control)[1]["state"] == "other")
    assert other("DELETE", control)[0] == 204


def until(found: Callable[[], T], within_s: float = 5.0) -> T:
    """Call `found` until its answer is true; return the answer."""
    end_s = time.monotonic() + within_s
    while not (answer := found()):
        assert time.monotonic() < end_s, answer
        time.sleep(0.05)
    return answer


def test_nothing_that_is_asked_for_is_ignored(stack: Stack) -> None:
    api = Api(stack, token(stack, "operator", "read", "drive"))
    status, refused = api("GET", f"/robots/{ROBOT}?verbose=1")
    assert (status, refused["code"]) == (400, "invalid") and "verbose" in refused["detail"]
    status, refused = api("POST", f"/robots/{ROBOT}/look-ahead", {"seconds": 2})
    assert (status, refused["code"]) == (400, "invalid") and "seconds" in refused["detail"]


def test_ending_a_token_ends_its_control_and_streams(stack: Stack) -> None:
    api = Api(stack, token(stack, "operator", "read", "drive", name="ends-soon"))
    watcher = Api(stack, token(stack, "observer", "read"))
    assert api("POST", f"/robots/{ROBOT}/control", {})[0] == 200
    assert "ends-soon" in watcher("GET", f"/robots/{ROBOT}")[1]["holder"]
    headers = {"Authorization": f"Bearer {api.token}"}
    news = urllib.request.Request(f"{stack.url}/api/v1/events?robot={ROBOT}", headers=headers)  # noqa: S310
    events = urllib.request.urlopen(news, timeout=ENDED_S)  # noqa: S310
    address = f"ws://127.0.0.1:{stack.port}/ws/robots/{ROBOT}/"
    page = websocket(address, additional_headers=headers, compression=None, max_size=None)
    assert events.readline() == b"retry: 2000\n"
    code = (
        "from fleet.accounts.tokens.models import Token; from fleet.accounts.tokens.services import token_end;"
        "one = Token.objects.get(name='ends-soon'); token_end(token=one, actor=one.user)"
    )
    manage(stack, "shell", "--no-imports", "-c", code)
    assert until(lambda: watcher("GET", f"/robots/{ROBOT}")[1]["holder"] is None, ENDED_S)
    assert api("GET", f"/robots/{ROBOT}")[1]["code"] == "token_invalid"
    with events:
        while events.readline():  # a stream that goes on gives a timeout
            pass
    end_s = time.monotonic() + ENDED_S
    with page, pytest.raises(ConnectionClosed):
        while time.monotonic() < end_s:
            page.recv(timeout=ENDED_S)


async def test_a_token_streams_the_pages_drive_messages(stack: Stack) -> None:
    text = await asyncio.to_thread(token, stack, "operator", "read", "drive")
    watcher = Api(stack, text)
    began = (await asyncio.to_thread(watcher, "GET", f"/robots/{ROBOT}"))[1]["state"]["odometry"]
    address = f"ws://127.0.0.1:{stack.port}/ws/robots/{ROBOT}/"
    async with connect(address, additional_headers={"Authorization": f"Bearer {text}"}) as socket:
        await socket.send(json.dumps({"t": "hello", "tab": "night-tests-0123456789"}))
        fence = None
        await socket.send(json.dumps({"t": "take"}))
        async for raw in socket:
            heard = json.loads(raw)
            if heard["t"] == "control" and heard["state"] == "yours":
                fence = heard["fence"]
                break
        for seq in range(1, 21):
            turn = 0.0 if seq < 4 else 0.3  # the stick begins in the middle
            drive = {"t": "drive", "fence": fence, "seq": seq, "sent_ms": 50.0 * seq, "x": 0.0, "w": turn}
            await socket.send(json.dumps(drive))
            await asyncio.sleep(0.05)
        await socket.send(json.dumps({"t": "say", "fence": fence, "text": "Hello", "language": "en-GB"}))
        async for raw in socket:
            heard = json.loads(raw)
            if heard["t"] == "refused" and heard["of"] == "say":
                break
        assert heard["refusal"]["code"] == "scope_missing"
        await socket.send(json.dumps({"t": "release"}))
    ended = (await asyncio.to_thread(watcher, "GET", f"/robots/{ROBOT}"))[1]["state"]["odometry"]
    assert turned_rad(began, ended) > 0.02


def turned_rad(began: dict[str, float], ended: dict[str, float]) -> float:
    """Return how far the robot has turned to the left, at most half a turn."""
    return math.remainder(ended["yaw"] - began["yaw"], math.tau)


def test_a_program_speaks_plays_and_reads_what_came_of_it(stack: Stack) -> None:
    api = Api(stack, token(stack, "operator", "read", "speak", "motions"))
    robot = f"/robots/{ROBOT}"
    status, refused = api("POST", f"{robot}/speech", {"text": "Hello", "language": "en-GB"})
    assert (status, refused["code"]) == (409, "no_lease")
    assert api("POST", f"{robot}/control", {})[0] == 200
    status, spoken = api("POST", f"{robot}/speech", {"text": "Hello", "language": "en-GB"})
    assert (status, spoken["kind"], spoken["outcome"]) == (202, "speech", None), spoken
    again = api("POST", f"{robot}/speech", {"text": "Hello", "language": "en-GB"}, key="greeting")
    assert again[1]["code"] == "speaking"  # the first text; the answer to this key is kept
    assert api("POST", f"{robot}/speech", {"text": "Hello", "language": "en-GB"}, key="greeting") == again
    status, ended = api("GET", f"{robot}/tasks/{spoken['number']}?wait=30")
    assert (status, ended["outcome"]) == (200, "done"), ended
    motions = [one["name"] for one in api("GET", f"{robot}/motions")[1]["motions"]]
    assert "home" in motions
    status, played = api("POST", f"{robot}/motions/home")
    assert status == 202, played
    assert api("GET", f"{robot}/tasks/{played['number']}?wait=30")[1]["outcome"] == "succeeded"
    status, refused = api("POST", f"{robot}/velocity", {"forward_mps": 0.1})
    assert (status, refused["code"], refused["figures"]) == (403, "scope_missing", {"scope": "drive"})
    stranger = Api(stack, token(stack, "observer", "read"))
    assert stranger("GET", f"{robot}/tasks/{played['number']}")[0] == 404
    assert api("DELETE", f"{robot}/control")[0] == 204


def test_a_program_stops_and_clears(stack: Stack) -> None:
    watcher = Api(stack, token(stack, "observer", "book"))  # a stop needs no special scope
    api = Api(stack, token(stack, "operator", "read", "drive"))
    robot = f"/robots/{ROBOT}"
    assert api("POST", f"{robot}/control", {})[0] == 200
    assert watcher("POST", f"{robot}/stop")[0] == 200
    status, refused = api("POST", f"{robot}/velocity", {"forward_mps": 0.1})
    assert (status, refused["rule"]) == (409, "stop"), refused
    number = api("GET", robot)[1]["state"]["stop"]["number"]
    assert api("POST", f"{robot}/stop/clear", {"number": number - 1})[0] == 409
    status, cleared = api("POST", f"{robot}/stop/clear", {"number": number})
    assert (status, cleared["state"]) == (200, "clear"), cleared
    assert api("POST", f"{robot}/velocity", {"forward_mps": 0.1})[0] == 200
    assert api("DELETE", f"{robot}/control")[0] == 204


def test_events_follow_a_robot_and_resume(stack: Stack) -> None:
    api = Api(stack, token(stack, "operator", "read", "drive"))
    robot = f"/robots/{ROBOT}"

    def follow(last: str = "") -> Any:
        headers = {
            "Authorization": f"Bearer {api.token}",
            "Accept": "text/event-stream",
            "Last-Event-ID": last,
        }
        address = f"{stack.url}/api/v1/events?robot={ROBOT}"
        return urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=10.0)  # noqa: S310

    def heard(stream: Any, kind: str) -> str:
        """Read until the first event of this kind; return its id."""
        number = ""
        for line in stream:
            name, _, value = line.decode().strip().partition(": ")
            number = value if name == "id" else number
            if (name, value) == ("event", kind):
                return number
        raise AssertionError(f"no {kind}")

    with follow() as stream:
        assert api("POST", f"{robot}/control", {})[0] == 200
        taken = heard(stream, "control.take")
    assert api("DELETE", f"{robot}/control")[0] == 204
    with follow(taken) as stream:
        ended = heard(stream, "control.end")
    assert int(ended) > int(taken)


def test_metrics_are_for_tokens_of_staff(stack: Stack) -> None:
    def scrape(token: str, query: str = "") -> tuple[int, str]:
        headers = {"Authorization": f"Bearer {token}"}
        request = urllib.request.Request(f"{stack.url}/metrics{query}", headers=headers)  # noqa: S310
        try:
            with urllib.request.urlopen(request, timeout=10.0) as answer:  # noqa: S310
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()

    assert scrape(token(stack, "operator", "read"))[0] == 403
    assert scrape("fleet_wrong")[0] == 401
    scraper = token(stack, "staff", "read")
    assert scrape(scraper, "?own=1")[0] == 200  # web processes ask each other like this
    status, text = scrape(scraper)
    assert status == 200
    assert f'fleet_robot_online{{robot="{ROBOT}"}} 1.0' in text
    assert re.search(r'fleet_http_request_seconds_count{.*route="metrics",status="403",.*} [1-9]', text)
    assert re.search(r'fleet_web_up{web="[0-9]+"} 1.0', text)


async def test_metrics_count_commands_decisions_and_viewers(stack: Stack) -> None:
    staff = token(stack, "staff", "read")

    def figure(name: str) -> float:
        request = urllib.request.Request(f"{stack.url}/metrics", headers={"Authorization": f"Bearer {staff}"})  # noqa: S310
        with urllib.request.urlopen(request, timeout=10.0) as answer:  # noqa: S310
            text = answer.read().decode()
        found = re.search(rf'^{name}{{[^}}]*robot="{ROBOT}"[^}}]*}} ([0-9.e+]+)$', text, re.MULTILINE)
        return float(found[1]) if found else 0.0

    names = ("fleet_command_forward_seconds_count", "fleet_bridge_decision_seconds_count")
    before = [await asyncio.to_thread(figure, name) for name in names]
    cookie = await asyncio.to_thread(sign_in, stack, "operator")
    others = await asyncio.to_thread(figure, "fleet_viewers")  # the programs of other tests also count
    async with Driver(stack, ROBOT, cookie) as driver:
        await driver.take()
        await driver.hold_stick(0.0, 0.2, until=lambda: driver.odometry and abs(driver.odometry.w) > 0.05)
        assert await asyncio.to_thread(figure, "fleet_viewers") == others + 1.0
        assert await asyncio.to_thread(figure, "fleet_link_up") == 1.0
        await driver.release()
    after = [await asyncio.to_thread(figure, name) for name in names]
    assert all(now > then for now, then in zip(after, before, strict=True)), (before, after)


def test_fifty_programs_wait_for_a_task_while_others_read(stack: Stack) -> None:
    api = Api(stack, token(stack, "operator", "read", "drive"))
    robot = f"/robots/{ROBOT}"
    assert api("POST", f"{robot}/control", {})[0] == 200
    status, task = api("POST", f"{robot}/drive-by", {"angle_rad": 3.1, "speed_radps": 0.05})
    assert status == 202, task
    with ThreadPoolExecutor(50) as pool:
        path = f"{robot}/tasks/{task['number']}?wait=30"
        waiting = [pool.submit(api, "GET", path) for _ in range(50)]
        assert [api("GET", robot)[0] for _ in range(3)] == [200] * 3
        assert not any(one.done() for one in waiting)  # the reads did not wait for the programs that wait
        assert api("DELETE", f"{robot}/drive-by")[0] == 204
        assert {one.result()[1]["outcome"] for one in waiting} == {"cancelled"}
    assert api("DELETE", f"{robot}/control")[0] == 204


def test_a_repeated_request_with_a_key_is_done_once(stack: Stack) -> None:
    api = Api(stack, token(stack, "operator", "read", "drive"))
    robot = f"/robots/{ROBOT}"
    assert api("POST", f"{robot}/control", {}, key="take")[0] == 200
    first = api("POST", f"{robot}/drive-by", {"angle_rad": 0.5}, key="turn")
    assert first[0] == 202
    assert api("POST", f"{robot}/drive-by", {"angle_rad": 0.5}, key="turn") == first
    assert api("GET", f"{robot}/tasks/{first[1]['number']}?wait=30")[1]["outcome"] == "done"
    assert api("POST", f"{robot}/drive-by", {"angle_rad": 0.6}, key="turn")[1]["code"] == "key_reused"
    assert api("DELETE", f"{robot}/control")[0] == 204


def test_a_program_reads_topics_and_publishes_by_the_allow_list(stack: Stack) -> None:
    api = Api(stack, token(stack, "operator", "read", "topics"))
    robot = f"/robots/{ROBOT}"
    status, graph = api("GET", f"{robot}/topics")
    assert status == 200, graph
    types = {topic["name"]: topic["type"] for topic in graph["topics"]}
    odometry = next(name for name, kind in types.items() if kind == "nav_msgs/Odometry")
    status, message = api("GET", f"{robot}/topics/message?topic={odometry}")
    assert (status, message["fields"]["child_frame_id"]) == (200, "base_footprint"), message
    status, found = api("GET", f"{robot}/topics/definition?type=nav_msgs/Odometry")
    assert [field["name"] for field in found["fields"]][:2] == ["header", "child_frame_id"]
    status, parameters = api("GET", f"{robot}/parameters")
    usage = next(name for name in parameters["names"] if name.endswith("/home/meta/usage"))
    assert isinstance(api("GET", f"{robot}/parameters/value?name={usage}")[1]["value"], str)
    status, refused = api("PUT", f"{robot}/parameters/value", {"name": usage, "value": "x"})
    assert (status, refused["rule"]) == (403, "account"), refused
    assert api("POST", f"{robot}/control", {})[0] == 200
    wrong = {"topic": "/rosout_agg", "type": "std_msgs/String", "fields": {}}
    status, refused = api("POST", f"{robot}/topics/publish", wrong)
    assert status in (403, 409), refused
    assert api("DELETE", f"{robot}/control")[0] == 204
    reader = Api(stack, token(stack, "operator", "read"))
    assert reader("GET", f"{robot}/topics")[1]["figures"] == {"scope": "topics"}


def docs_programs(language: str, stack: Stack) -> list[str]:
    """Return the programs of docs/api.md in a language, for this console."""
    text = (REPOSITORY / "docs" / "api.md").read_text().replace("127.0.0.1:8000", f"127.0.0.1:{stack.port}")
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def run_docs(stack: Stack, words: list[str], text: str, **environment: str) -> str:
    """Run a program of the docs and return what it printed."""
    done = subprocess.run(
        words,
        input=text,
        env={**os.environ, "TOKEN": token(stack, "operator", *SCOPES), **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=180.0,
    )
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return done.stdout


def test_the_programs_of_the_docs_run_as_they_are(stack: Stack, tmp_path: Path) -> None:
    """The programs are copied from docs/api.md, with the port of this console."""
    (tmp_path / ".curlrc").write_text("fail-with-body\nsilent\nshow-error\n")
    [commands] = docs_programs("bash", stack)
    said = run_docs(stack, ["bash", "-e"], commands, CURL_HOME=str(tmp_path))
    assert '"kind":"drive_by"' in said and '"outcome":"done"' in said, said
    staff = Api(stack, token(stack, "staff", "read", "drive"))
    stop = staff("GET", f"/robots/{ROBOT}")[1]["state"]["stop"]
    assert (stop["state"], stop["number"] > 0) == ("clear", True)
    square, stream = docs_programs("python", stack)
    began = staff("GET", f"/robots/{ROBOT}")[1]["state"]["odometry"]
    assert run_docs(stack, [sys.executable, "-"], square).split() == ["done"] * 8
    ended = staff("GET", f"/robots/{ROBOT}")[1]["state"]["odometry"]
    assert abs(ended["x"] - began["x"]) < 0.05
    assert abs(ended["y"] - began["y"]) < 0.05
    run_docs(stack, [sys.executable, "-"], stream)
    assert turned_rad(ended, staff("GET", f"/robots/{ROBOT}")[1]["state"]["odometry"]) > 0.1
