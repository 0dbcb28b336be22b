"""A class signs in at the same moment, by the page's form, each with a browser of its own."""

from __future__ import annotations

import http.client
import re
import threading
import time
from typing import NamedTuple
from urllib.parse import urlencode

from script.stack.stack import Stack

PAGE = "/accounts/sign-in/"
STOPS_EVERY_S = 0.2


class Signed(NamedTuple):
    """The seconds that each person waited, the statuses, and the seconds of the stops pressed meanwhile."""

    waited_s: list[float]
    statuses: list[int]
    stops_s: list[float]


def class_signs_in(stack: Stack, people: int, password: str, stop_cookie: str) -> Signed:
    """Let `student-0` ... sign in at once. Somebody presses *Stop all* again and again until all are in."""
    browsers = [_Browser(stack) for _ in range(people)]
    ready, waited_s, statuses = threading.Barrier(people + 1), list[float](), list[int]()

    def one(number: int) -> None:
        ready.wait()
        began_s = time.perf_counter()
        statuses.append(browsers[number].sign_in(f"student-{number}", password))
        waited_s.append(time.perf_counter() - began_s)

    threads = [threading.Thread(target=one, args=(number,)) for number in range(people)]
    for thread in threads:
        thread.start()
    ready.wait()
    stops_s = []
    while any(thread.is_alive() for thread in threads):
        stops_s.append(stop_s(stack, stop_cookie))
        time.sleep(STOPS_EVERY_S)
    return Signed(waited_s, statuses, stops_s)


def stop_s(stack: Stack, cookie: str) -> float:
    """Press *Stop all*; return the seconds until the answer."""
    token = re.findall(r"csrf\w*=(\w+)", cookie)[0]
    connection = http.client.HTTPConnection("127.0.0.1", stack.port, timeout=60.0)
    headers = {"Cookie": cookie, "Origin": stack.url, "X-CSRFToken": token, "Accept": "application/json"}
    began_s = time.perf_counter()
    connection.request("POST", "/api/v1/stop", b"", headers)
    answer = connection.getresponse()
    answer.read()
    took_s = time.perf_counter() - began_s
    connection.close()
    if answer.status != 200:
        raise AssertionError(f"the stop was answered by {answer.status}")
    return took_s


class _Browser:
    """A browser that has loaded the page."""

    def __init__(self, stack: Stack) -> None:
        self._connection = http.client.HTTPConnection("127.0.0.1", stack.port, timeout=120.0)
        self._connection.request("GET", PAGE)
        answer = self._connection.getresponse()
        [self._token] = set(re.findall(r'name="csrfmiddlewaretoken" value="([^"]+)"', answer.read().decode()))
        self._headers = {
            "Cookie": (answer.getheader("Set-Cookie") or "").split(";")[0],
            "Content-Type": "application/x-www-form-urlencoded",
            "Origin": stack.url,
        }

    def sign_in(self, username: str, password: str) -> int:
        form = {"csrfmiddlewaretoken": self._token, "username": username, "password": password}
        self._connection.request("POST", PAGE, urlencode(form), self._headers)
        answer = self._connection.getresponse()
        answer.read()
        self._connection.close()
        return answer.status
