"""Many parallel guesses of passwords at the real server."""

import http.client
import re
import sqlite3
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import urlencode

import pytest

from fleet.accounts.sign_in import throttle

PAGE = "/accounts/sign-in/"
GUESSES = throttle.FAILURES + 4  # more than are looked at, and than the queue lets in at once


class Guesser:
    """A browser at the sign-in page."""

    def __init__(self, port):
        self.connection = http.client.HTTPConnection("127.0.0.1", port, timeout=120)
        self.connection.request("GET", PAGE)
        answer = self.connection.getresponse()
        page = answer.read().decode()
        self.token = re.search(r'name="csrfmiddlewaretoken" value="(\w+)"', page)[1]
        self.cookie = answer.getheader("Set-Cookie").split(";")[0]

    def guess(self, username, password):
        """Try a password; return the status."""
        form = urlencode({"csrfmiddlewaretoken": self.token, "username": username, "password": password})
        headers = {"Cookie": self.cookie, "Content-Type": "application/x-www-form-urlencoded"}
        self.connection.request("POST", PAGE, form, headers)
        answer = self.connection.getresponse()
        answer.read()
        return answer.status


@pytest.fixture
def failures(web):
    """Count the recorded failed sign-ins from now on."""
    database = sqlite3.connect(Path(web.environ["FLEET_VAR"]) / "fleet.sqlite3")
    sql = "SELECT count(*) FROM audit_record WHERE kind = 'account.sign_in_failed'"
    (before,) = database.execute(sql).fetchone()
    yield lambda: database.execute(sql).fetchone()[0] - before
    database.close()


def test_parallel_guesses_count_like_serial_ones(web, failures):
    with ThreadPoolExecutor(GUESSES) as everybody:
        guessers = list(everybody.map(Guesser, [web.port] * GUESSES))
        statuses = list(everybody.map(lambda guesser: guesser.guess("first", "wrong"), guessers))
    assert failures() <= throttle.FAILURES
    assert statuses.count(200) == failures()
    assert {status for status in statuses if status != 200} <= {429, 503}


def test_a_page_is_served_while_passwords_are_looked_at(web):
    with ThreadPoolExecutor(GUESSES) as everybody:
        guessers = list(everybody.map(Guesser, [web.port] * GUESSES))
        waiting = [
            everybody.submit(guesser.guess, f"nobody-{number}", "x")
            for number, guesser in enumerate(guessers)
        ]
        while b" 200 OK" not in web.say(b"GET /healthz HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n"):
            pass
        assert not all(guess.done() for guess in waiting)
        assert {guess.result() for guess in waiting} == {200}  # nobody is turned away
