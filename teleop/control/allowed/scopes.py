"""The scopes that a program's token needs for each message."""

from __future__ import annotations

from typing import Any

from fleet.accounts.tokens.models import Scope
from robots.shared import wire
from robots.shared.sentences import say
from robots.shared.wire import Refusal

# A token with any of these scopes may take control.
ACTING = (Scope.DRIVE, Scope.SPEAK, Scope.MOTIONS, Scope.TOPICS)
_NEEDED: dict[type, tuple[Scope, ...]] = {
    request: (Scope(kind.scope),) for kind in wire.TASK_KINDS for request in kind.requests
} | {
    wire.Drive: (Scope.DRIVE,),
    wire.CameraView: (Scope.DRIVE,),
    wire.Clear: (Scope.DRIVE,),
    **dict.fromkeys((wire.Hello, wire.Ack, wire.Ping, wire.Refresh, wire.ShowJoints), (Scope.READ, *ACTING)),
}


def needed_scopes(message: Any) -> tuple[Scope, ...]:
    """Return the scopes of which a token needs at least one. Messages about control itself need one of `ACTING`."""
    return _NEEDED.get(type(message), ACTING)


def scope_missing(scopes: tuple[Scope, ...]) -> Refusal:
    """Return the refusal of a token that has none of these scopes."""
    names = " or ".join(f"“{scope.value}”" for scope in scopes)
    text = say(
        "This token lacks the scope {names}. Make one that has it, on the page Your account.", names=names
    )
    return Refusal("scope_missing", text, "account", {"scope": " ".join(scope.value for scope in scopes)})
