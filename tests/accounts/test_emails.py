"""E-mails sent at once: a refused one delays no other, and none is lost while the server does not answer."""

from __future__ import annotations

import threading
from smtplib import SMTPDataError, SMTPRecipientsRefused, SMTPServerDisconnected
from types import TracebackType
from typing import Any

import pytest
from django.core.mail import EmailMessage

from fleet.accounts import emails


class Server:
    """A mail server that raises the next error from `answers`; without an error, it accepts the message."""

    def __init__(self) -> None:
        self.answers: dict[str, list[Exception]] = {}
        self.took: list[str] = []

    def __enter__(self) -> Server:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def send_messages(self, messages: list[EmailMessage]) -> int:
        [message] = messages
        if answers := self.answers.get(message.to[0]):
            raise answers.pop(0)
        self.took += message.to
        return 1


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Server:
    server = Server()
    monkeypatch.setattr(emails, "get_connection", lambda **_options: server)
    monkeypatch.setattr(emails, "AGAIN_S", (0.0, 0.0))
    return server


def send(*people: str) -> None:
    before = set(threading.enumerate())
    emails._in_background([EmailMessage("Welcome", "", to=[person]) for person in people])
    for thread in set(threading.enumerate()) - before:
        thread.join(10)


def refused(code: int, person: str) -> SMTPRecipientsRefused:
    return SMTPRecipientsRefused({person: (code, b"no")})


def test_an_address_that_the_server_refuses_holds_up_no_other(server: Server, caplog: Any) -> None:
    server.answers = {"ada": [refused(550, "ada")], "bob": [SMTPDataError(554, b"spam")]}
    send("ada", "bob", "eve")
    assert server.took == ["eve"]
    assert caplog.text.count("refused an e-mail") == 2


@pytest.mark.parametrize(
    "answer", [refused(450, "ada"), SMTPServerDisconnected("gone"), TimeoutError("timed out")]
)
def test_a_busy_or_absent_mail_server_gets_each_letter_once(
    server: Server, answer: Exception, caplog: Any
) -> None:
    server.answers = {"bob": [answer]}
    send("ada", "bob", "eve")
    assert sorted(server.took) == ["ada", "bob", "eve"]
    assert "tried again" in caplog.text


def test_a_server_that_stays_away_is_given_up_in_words(server: Server, caplog: Any) -> None:
    server.answers = {"ada": [TimeoutError("timed out")] * 3}
    send("ada")
    assert server.took == []
    assert "are lost (1): timed out" in caplog.text
