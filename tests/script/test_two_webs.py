"""Two web processes share PostgreSQL and Redis: people at one process see and stop robots driven at the other."""

from __future__ import annotations

import asyncio
import json
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from robots.shared import wire
from robots.shared.processes.shutdown import EXIT_ALREADY_RUNNING
from script.stack.client import Driver, sign_in
from script.stack.places import REPOSITORY
from script.stack.stack import PRACTICE_ROBOTS
from tests.processes import until
from tests.script.house import House
from tests.script.programs.rosbridge_client import RosbridgeClient
from tests.script.support import drive_forward, token

NEWS_S = 15.0
ZERO_S = 2.0  # s, from the kill of a web process until a page shows that the robot stands
ROBOT = PRACTICE_ROBOTS[0].slug


def test_a_program_at_another_web_process_learns_the_remedy(house: House) -> None:
    stack = house.stack
    text = token(stack, "operator", "read", "drive")

    def ask(method: str, path: str, port: int) -> tuple[int, Any]:
        request = urllib.request.Request(
            f"http://{stack.hosts[0]}:{port}/api/v1/robots/{ROBOT}/control{path}",
            b"{}" if method == "POST" else None,
            {"Authorization": f"Bearer {text}", "Content-Type": "application/json"},
            method=method,
        )
        try:
            with urllib.request.urlopen(request, timeout=20.0) as answer:  # noqa: S310
                raw = answer.read()
                return answer.status, json.loads(raw) if raw else None
        except urllib.error.HTTPError as error:
            return error.code, json.loads(error.read())

    first, second = stack.port, house.second_port
    assert ask("POST", "", first)[1]["state"] == "yours"
    status, refused = ask("POST", "/renew", second)
    assert (status, refused["code"]) == (409, "other_process"), refused
    assert ask("GET", "", second)[1]["refusal"]["code"] == "other_process"
    assert ask("POST", "/renew", first)[0] == 200  # the first web process still has control
    assert ask("POST", "", second)[1]["state"] == "yours"  # control has moved
    assert ask("POST", "/renew", second)[0] == 200
    until(lambda: ask("POST", "/renew", first)[1].get("code") == "other_process", "the first knows", NEWS_S)
    assert ask("DELETE", "", second)[0] == 204
    until(lambda: ask("POST", "/renew", first)[1]["code"] == "no_lease", "the first knows of the end", NEWS_S)


def test_a_second_supervisor_ends_and_changes_nothing(house: House, tmp_path: Path) -> None:
    """As on another computer: only the database is the same."""
    own = {name: str(tmp_path) for name in ("FLEET_VAR", "FLEET_RUN_DIR")}
    tmp_path.chmod(0o700)
    second = subprocess.run(
        [sys.executable, "manage.py", "run_fleet"],
        cwd=REPOSITORY,
        env=house.stack.environment | own,
        capture_output=True,
        text=True,
        timeout=60.0,
    )
    assert second.returncode == EXIT_ALREADY_RUNNING
    assert f"{socket.gethostname()[:28]}, process {house.stack.supervisor.pid}" in second.stderr
    assert not list(tmp_path.glob("*.sock"))


def test_clients_of_either_web_process_find_each_other(house: House) -> None:
    asyncio.run(share(house))


async def share(house: House) -> None:
    stack = house.stack
    texts = [token(stack, role, "topics", name=role) for role in ("operator", "supervisor")]
    add, count = "/fleet/clients/add_two_ints", "/fleet/clients/fibonacci"
    count_type = "actionlib_tutorials/FibonacciAction"
    async with (
        RosbridgeClient(stack, ROBOT, texts[0]) as server,
        RosbridgeClient(stack, ROBOT, texts[1], port=house.second_port) as other,
    ):
        offer = {"op": "advertise_service", "service": add, "type": "rospy_tutorials/AddTwoInts"}
        await server.send(offer)
        await server.send({"op": "advertise_action", "action": count, "type": count_type})
        await other.send({"op": "subscribe", "topic": f"{count}/status"})
        await lists(other, "action_servers", count)
        await lists(other, "services", add)
        await other.send(offer)
        await other.told("name_taken")

        asking = asyncio.create_task(other.ask(add, a=2, b=3))
        called = await came(server, "call_service")
        assert called["args"] == {"a": 2, "b": 3}
        await server.send({**called, "op": "service_response", "values": {"sum": 5}, "result": True})
        assert (await asking)["values"] == {"sum": 5}

        goal = {
            "op": "send_action_goal",
            "action": count,
            "id": "mine",
            "args": {"order": 3},
            "feedback": True,
        }
        await other.send(goal)
        taken = await came(server, "send_action_goal")
        said = {"action": count, "id": taken["id"]}
        await server.send({"op": "action_feedback", "values": {"sequence": [0]}, **said})
        assert (await came(other, "action_feedback"))["values"] == {"sequence": [0]}
        await other.send({"op": "cancel_action_goal", "action": count, "id": "mine"})
        await came(server, "cancel_action_goal")
        await server.send({"op": "action_result", "values": {}, "status": 5, "result": True, **said})
        assert (await came(other, "action_result"))["status"] == 5

        await server.send({"op": "publish", "topic": f"{count}/status", "msg": {"status_list": []}})
        assert (await came(other, "publish"))["msg"] == {"status_list": []}

        asking = asyncio.create_task(other.ask(add))
        await came(server, "call_service")
        await server.socket.close()
        assert (await asking)["values"].startswith("client_left: ")
        await lists(other, "services", add, still=False)


async def lists(client: RosbridgeClient, kind: str, name: str, *, still: bool = True) -> None:
    """Wait until rosapi lists this name, or does not any more."""
    end_s = time.monotonic() + NEWS_S
    while (name in (await client.call(f"/rosapi/{kind}"))[kind]) != still:
        assert time.monotonic() < end_s
        await asyncio.sleep(0.1)


async def came(client: RosbridgeClient, op: str) -> dict[str, Any]:
    """Wait for an operation of another client, and take it."""
    await client.until(lambda: any(one["op"] == op for one in client.messages), NEWS_S)
    found = next(one for one in client.messages if one["op"] == op)
    client.messages.remove(found)
    return found


@pytest.mark.last  # Redis and the second web process die
def test_control_and_stop_are_the_same_through_either(house: House) -> None:
    asyncio.run(meet(house))


async def meet(house: House) -> None:
    stack = house.stack
    operators, supervisors = await asyncio.gather(
        asyncio.to_thread(sign_in, stack, "operator"), asyncio.to_thread(sign_in, stack, "supervisor")
    )
    async with (
        Driver(stack, ROBOT, operators) as operator,
        Driver(stack, ROBOT, supervisors, port=house.second_port) as supervisor,
    ):
        await operator.take()
        await supervisor.until(lambda: holder(supervisor) == "Operator", NEWS_S)

        await supervisor.send(wire.Ask())
        await operator.until(lambda: operator.control and operator.control.requests, NEWS_S)
        assert operator.control
        [asked] = operator.control.requests
        await operator.send(wire.HandOver(asked.number))
        await supervisor.until(lambda: supervisor.fence, NEWS_S)
        await operator.until(lambda: holder(operator) == "Supervisor", NEWS_S)
        await drive_a_little(supervisor)

        await operator.stop()
        for page in (operator, supervisor):
            await page.until(lambda page=page: page.state and page.state.stop.state == "stopped", NEWS_S)
        assert supervisor.state and supervisor.state.stop.by == "Operator"
        await supervisor.clear()
        await operator.until(lambda: operator.state and operator.state.stop.state == "clear", NEWS_S)

        assert not house.said("hint")
        house.redis.kill()  # without Redis, news arrives later: nothing else changes
        await drive_a_little(supervisor)
        await supervisor.send(wire.Release())
        await operator.until(lambda: operator.control and operator.control.state == "free", NEWS_S)
        await supervisor.take()
        await operator.until(lambda: holder(operator) == "Supervisor", NEWS_S)

        await drive_a_little(supervisor)
        house.second.signal(signal.SIGKILL)
        killed_s = time.monotonic()
        await operator.until(lambda: operator.odometry and abs(operator.odometry.vx) < 0.01)
        assert time.monotonic() - killed_s < ZERO_S

    fence = supervisor.fence
    async with Driver(
        stack, ROBOT, supervisors, tab=supervisor.tab
    ) as resumed:  # through the other web process
        await resumed.until(lambda: resumed.fence)
        assert resumed.fence == fence
        await drive_a_little(resumed)
    stack.release(house.second)


def holder(page: Driver) -> str | None:
    return page.control.holder if page.control and page.control.state == "other" else None


async def drive_a_little(driver: Driver) -> None:
    await driver.until(lambda: driver.odometry and driver.state and driver.state.fence == driver.fence)
    await driver.drive(0.0, 0.0)  # the bridge first needs a neutral stick
    await drive_forward(driver)
