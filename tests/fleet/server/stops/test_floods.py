"""A stop of somebody who may stop that robot passes, whatever strangers and colleagues send at the same time.

The server may send stops of a flood after its test. So a test that looks at each press uses the robot "apart", which
only the presser may stop.
"""

import json

import pytest

from fleet.server import limits
from teleop.stop.emergency_stop import PACE_S
from tests.fleet.server.conftest import heard
from tests.processes import until

FLOOD = 60
MANY = tuple(f"127.0.0.{last}" for last in range(2, 22))
MEGABYTE = 1024 * 1024


def robots_in(body):
    return json.loads(body)["robots"]


@pytest.fixture(params=["session", "token", "form"])
def press(request, crowd):
    """`press(person, robot)`: that person's stop by one of the doors, as bytes."""

    def by_this_door(person, robot):
        return {
            "session": crowd.by_session(person),
            "token": crowd.by_token(person, f"/api/v1/robots/{robot}/stop"),
            "form": crowd.head(
                "/stop-all/",
                f"Cookie: {person['cookie']}",
                f"X-CSRFToken: {person['csrf']}",
                "Accept: text/html",
            ),
        }[request.param]

    return by_this_door


@pytest.fixture
def stop(press, crowd):
    """A stop of the presser by one of the doors, as bytes."""
    return press(crowd.presser, "apart")


@pytest.mark.parametrize("addresses", [("127.0.0.1",), MANY], ids=["one address", "many addresses"])
@pytest.mark.parametrize("kind", ["sessions", "tokens", "invented sessions", "invented tokens", "nothing"])
def test_a_stop_waits_for_no_stop_of_strangers(crowd, stop, session_cookie, kind, addresses):
    """The pages process, which answers strangers, hangs; all of them wait for it."""
    requests = {
        "sessions": [crowd.by_session(one) for one in crowd.strangers],
        "tokens": [crowd.by_token(one) for one in crowd.strangers],
        "invented sessions": [
            crowd.head("/stop-all/", f"Cookie: {session_cookie}={n:032}") for n in range(FLOOD)
        ],
        "invented tokens": [
            crowd.head("/api/v1/stop", f"Authorization: Bearer fleet_{n}") for n in range(FLOOD)
        ],
        "nothing": [crowd.head("/api/v1/stop")],
    }[kind]
    with crowd.pages_frozen(), crowd.flood((requests * FLOOD)[:FLOOD], addresses):
        status, _ = crowd.says(stop)
    assert status == 200
    assert {press.by for press in crowd.watchdog_apart.heard} == {"presser 0"}


def test_open_requests_of_two_addresses_refuse_no_stop(crowd, stop):
    slow = crowd.head("/", method="GET")
    requests = [slow] * (limits.REQUESTS + 40)
    with crowd.pages_frozen(), crowd.flood(requests, ("127.0.0.2", "127.0.0.1")):
        until(lambda: crowd.says(slow)[0] == 503, "all places are taken", 30)
        assert crowd.says(stop)[0] == 200


def test_connections_of_an_address_refuse_no_stop(crowd, stop):
    """Half of them wait with a stranger's stop, half with an unfinished head."""
    unfinished = crowd.head("/stop-all/")[:-2]
    requests = [crowd.by_token(crowd.strangers[0]), unfinished] * (limits.CONNECTIONS_OF_ADDRESS // 2 + 10)
    with crowd.pages_frozen(), crowd.flood(requests):
        assert crowd.says(stop)[0] == 200


def test_presses_of_many_people_share_few_messages(crowd):
    """The first press is under way; all others share the next one."""
    crowd.watchdog.silent = True
    presses = [crowd.by_session(one) for one in crowd.colleagues[:5]] * 8
    presses += [crowd.by_token(one) for one in crowd.colleagues] * 2
    with crowd.flood(presses, MANY) as connections:
        until(lambda: crowd.watchdog.heard, "the first press arrives")
        crowd.watchdog.silent = False
        for connection in connections:
            assert b" 20" in connection.recv(65536)[:20]  # the first presses are pending: 202
    assert len(crowd.watchdog.heard) < 10 + 2.0 / PACE_S


def test_a_stop_passes_between_the_stops_of_colleagues(crowd, press):
    presses = [crowd.by_session(one, "/stop-all/") for one in crowd.colleagues[:9]] * 8
    with crowd.flood(presses, MANY):
        assert crowd.says(press(crowd.colleagues[9], "in-service"))[0] == 200


def test_bodies_of_strangers_use_up_no_memory_of_a_stop(crowd, session_cookie):
    claim = crowd.head("/accounts/sign-in/", f"Cookie: {session_cookie}=x").replace(
        b"Content-Length: 0", b"Content-Length: %d" % limits.SIGNED_IN_BODY_BYTES
    )
    person = crowd.colleagues[0]
    form = b"csrfmiddlewaretoken=" + person["csrf"].encode()
    stop = crowd.head("/stop-all/", f"Cookie: {person['cookie']}", "Accept: application/json").replace(
        b"Content-Length: 0",
        b"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: %d" % len(form),
    )
    with crowd.flood([claim] * (limits.BODIES_BYTES // limits.SIGNED_IN_BODY_BYTES)):
        until(lambda: b"busy" in crowd.says(claim)[1], "no memory is left")
        assert crowd.says(stop + form)[0] == 200


def test_a_token_stops_without_its_body(crowd):
    head = crowd.by_token(crowd.colleagues[0]).replace(b"Length: 0", b"Length: 1000")
    assert crowd.says(head)[0] == 200


def test_a_token_stops_next_to_a_session_that_has_ended(crowd, session_cookie):
    """Here without the pages process: a known person's stop does not wait among those of strangers."""
    token = f"Authorization: Bearer {crowd.presser['token']}"
    with crowd.pages_frozen():
        assert crowd.says(crowd.head("/api/v1/stop", f"Cookie: {session_cookie}=ended", token))[0] == 200
    assert [press.by for press in crowd.watchdog_apart.heard] == ["presser 0"]


def test_a_robot_may_be_named_in_an_encoded_address(crowd):
    with crowd.pages_frozen():
        stop = crowd.by_token(crowd.colleagues[0], "/api/v1/robots/in%2Dservice/stop")
        assert robots_in(crowd.says(stop)[1]).keys() == {"in-service"}


def test_a_stop_has_exactly_the_robots_of_its_person(crowd):
    person = crowd.presser
    assert robots_in(crowd.says(crowd.by_token(person))[1]).keys() == {"apart"}
    named = "/api/v1/robots/out-of-service/stop"
    assert robots_in(crowd.says(crowd.by_session(person, named))[1]).keys() == {"out-of-service"}
    assert [len(one.heard) for one in (crowd.watchdog_apart, crowd.idle_watchdog)] == [1, 1]
    assert crowd.says(crowd.by_token(person, "/api/v1/robots/nowhere/stop"))[0] == 404
    assert robots_in(crowd.says(crowd.by_token(crowd.strangers[0]))[1]) == {}
    assert crowd.says(crowd.by_session(crowd.strangers[0], "/robots/in-service/stop/"))[0] == 404


def test_another_site_cannot_press_with_a_cookie(crowd):
    person = crowd.presser
    for lines in (
        [f"Cookie: {person['cookie']}"],
        [f"Cookie: {person['cookie']}", "X-CSRFToken: " + "x" * 32],
    ):
        for path in ("/api/v1/stop", "/stop-all/"):
            assert crowd.says(crowd.head(path, *lines))[0] == 403
    forged = crowd.by_session(person).replace(b"Origin: http://127.0.0.1", b"Origin: http://evil.example")
    assert crowd.says(forged)[0] == 403
    assert crowd.watchdog_apart.heard == []


def test_pipelined_stops_are_answered_in_order(crowd):
    one = crowd.by_token(crowd.colleagues[0])
    last = one.replace(b"HTTP/1.1", b"HTTP/1.0")
    with crowd.web.connect() as connection:
        connection.sendall(one * 20 + last)
        assert heard(connection).count(b" 200 OK") == 21


@pytest.mark.parametrize("method", ["GET", "HEAD", "PUT", "DELETE", "OPTIONS"])
def test_other_methods_stop_nothing(crowd, method):
    request = crowd.by_token(crowd.presser).replace(b"POST", method.encode(), 1)
    with crowd.web.connect() as connection:
        connection.sendall(request.replace(b"HTTP/1.1", b"HTTP/1.0"))
        assert b" 405 " in heard(connection)[:20]
    assert crowd.watchdog_apart.heard == []
