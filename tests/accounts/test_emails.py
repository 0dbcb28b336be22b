"""E-mails sent at once: a refused one delays no other, and none is lost while the server does not answer."""

from __future__ import annotations

import threading
from smtplib import (
    SMTPDataError,
    SMTPNotSupportedError,
    SMTPRecipientsRefused,
    SMTPSenderRefused,
    SMTPServerDisconnected,
)
from typing import Any

import pytest
from django.core.mail import EmailMessage

from fleet.accounts import emails


class Server:
    """A mail server that raises the next error from `answers`; without an error, it accepts the message."""

    def __init__(self) -> None:
        self.answers: dict[str, list[Exception]] = {}
        self.took: list[str] = []
        self.recorded: list[str] = []  # in the log: addresses that were refused

    def open(self) -> None: ...

    def close(self) -> None: ...

    def send_messages(self, messages: list[EmailMessage]) -> int:
        [message] = messages
        if answers := self.answers.get(message.to[0]):
            raise answers.pop(0)
        self.took += message.to
        return 1


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Server:
    server = Server()
    monkeypatch.setattr(emails, "record", lambda kind, private: server.recorded.append(private["address"]))
    monkeypatch.setattr(emails, "_note", lambda _addresses, _refused_at: None)
    monkeypatch.setattr(emails, "get_connection", lambda **_options: server)
    monkeypatch.setattr(emails, "AGAIN_S", (0.0, 0.0))
    return server


def send(*people: str) -> None:
    before = set(threading.enumerate())
    emails.send_at_once([EmailMessage("Welcome", "", to=[person]) for person in people])
    for thread in set(threading.enumerate()) - before:
        thread.join(10)


def refused(code: int, person: str, words: bytes = b"no") -> SMTPRecipientsRefused:
    return SMTPRecipientsRefused({person: (code, words)})


def test_an_address_that_the_server_refuses_holds_up_no_other(server: Server, caplog: Any) -> None:
    server.answers = {
        "ada": [refused(550, "ada")],
        "\u00e4da": [SMTPNotSupportedError("no SMTPUTF8")],
        "b\u00f6b": [UnicodeEncodeError("ascii", "b\u00f6b", 1, 2, "no")],
    }
    send(*server.answers, "eve")
    assert server.took == ["eve"]
    assert server.recorded == ["ada", "\u00e4da", "b\u00f6b"]
    assert caplog.text.count("refused an e-mail") == 3


def test_one_that_is_always_busy_holds_up_no_other(server: Server) -> None:
    server.answers = {"ada": [refused(421, "ada")] * 3}  # the server ends the connection
    send("ada", "bob", "eve")
    assert server.took == ["bob", "eve"]


@pytest.mark.parametrize(
    "answer",
    [
        refused(450, "bob"),
        refused(553, "bob", b"5.7.1 <us>: Sender address rejected"),
        SMTPSenderRefused(553, b"sender not allowed", "us"),
        SMTPDataError(550, b"5.4.5 daily sending limit exceeded"),
        SMTPServerDisconnected("gone"),
        TimeoutError("timed out"),
    ],
)
def test_a_server_that_takes_no_letter_now_gets_each_one_once(
    server: Server, answer: Exception, caplog: Any
) -> None:
    server.answers = {"bob": [answer]}
    send("ada", "bob", "eve")
    assert sorted(server.took) == ["ada", "bob", "eve"]
    assert server.recorded == []
    assert "tried again" in caplog.text


def test_a_server_that_stays_away_is_given_up_in_words(server: Server, caplog: Any) -> None:
    server.answers = {"ada": [TimeoutError("timed out")] * 3}
    send("ada")
    assert server.took == []
    assert "are lost (1): timed out" in caplog.text


@pytest.mark.parametrize("sender", ["Robots, Lab <us@lab.example>", "Robots <>", "us@"])
def test_a_malformed_sender_blames_nobody_and_loses_nothing(
    server: Server, settings: Any, caplog: Any, sender: str
) -> None:
    settings.DEFAULT_FROM_EMAIL = sender
    waiting = [EmailMessage("Welcome", "", to=["ada@lab.example"])]
    cause = emails._try_to_send(waiting)
    assert cause.startswith(f"FLEET_EMAIL_FROM is {sender!r}")
    assert (len(waiting), server.recorded) == (1, [])


def test_a_message_that_cannot_be_written_blames_no_address(server: Server) -> None:
    server.answers = {"ada@lab.example": [ValueError("Header values can't contain newlines")]}
    waiting = [
        EmailMessage("Welcome", "", to=["ada@lab.example"]),
        EmailMessage("", "", to=["eve@lab.example"]),
    ]
    assert "newlines" in emails._try_to_send(waiting)
    assert ([one.to for one in waiting], server.recorded, server.took) == (
        [["ada@lab.example"]],
        [],
        ["eve@lab.example"],
    )
