"""Passwords are hashed by processes of their own, which start again if they end or do not answer."""

import os
import signal

import bcrypt
import pytest

from fleet.accounts.sign_in import hashing
from fleet.accounts.sign_in.hashing import HashProcess

TEXT, SALT = b"text", bcrypt.gensalt(4)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_process_that_does_not_answer_is_replaced(how, monkeypatch):
    process = HashProcess()
    right = process.hash(TEXT, SALT)
    assert right == bcrypt.hashpw(TEXT, SALT)
    first = process._running
    os.kill(first.pid, how)
    monkeypatch.setattr(process, "_start", lambda start=process._start: _patient(monkeypatch, start))
    monkeypatch.setattr(hashing, "ANSWER_S", 0.2)
    assert process.hash(TEXT, SALT) == right
    assert first.returncode == -signal.SIGKILL and process._running is not first
    process._running.kill()
    process._running.communicate()


def test_two_that_do_not_answer_are_an_error_and_the_next_one_works(monkeypatch):
    process = HashProcess()
    monkeypatch.setattr(hashing, "ANSWER_S", 0.0)
    with pytest.raises(RuntimeError):
        process.hash(TEXT, SALT)
    monkeypatch.undo()
    assert process.hash(TEXT, SALT) == bcrypt.hashpw(TEXT, SALT)
    process._running.kill()
    process._running.communicate()


def _patient(monkeypatch, start):
    monkeypatch.setattr(hashing, "ANSWER_S", 30.0)
    return start()
