"""The topics that take a holder's input."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from robots.bridge.robot.incoming.reception import Reception
from robots.bridge.robot.inputs import Inputs
from tests.bridge.support import CONFIG


class AtOnce:
    """A worker without a thread."""

    def do(self, call):
        call()


def test_a_connection_that_fails_is_never_taken_for_one(monkeypatch):
    def fails(_use, _topics):
        raise ValueError("no answer of a robot's")

    changes = []
    reception = Reception(CONFIG.topics)
    reception.core = SimpleNamespace(
        tasks=SimpleNamespace(routing=SimpleNamespace(attended=lambda *how: changes.append(how)))
    )
    monkeypatch.setattr(reception, "post", lambda later: later())
    with pytest.raises(ValueError, match="no answer"):
        Inputs("/key_vel", reception, AtOnce(), fails).attend("drive", frozenset({"/key_vel", "/phone_vel"}))
    [(use, connected, _)] = changes
    assert (use, connected) == ("drive", None)
