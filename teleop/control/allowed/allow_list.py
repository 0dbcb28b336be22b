"""The allow-list: the role that a person needs for a topic, service or parameter."""

from __future__ import annotations

from collections.abc import Iterable

from robots.registry.models import Role
from robots.shared.configuration.bridge_config import Allowed
from robots.shared.messages.type_names import bare
from robots.shared.sentences import say
from robots.shared.wire import Refusal
from teleop.control.status import Rights

ROLES = {
    Role.OBSERVER: say("observer"),
    Role.OPERATOR: say("operator"),
    Role.SUPERVISOR: say("supervisor"),
    Role.STAFF: say("staff"),
}


def required_role(
    allowed: Iterable[Allowed], what: str, name: str, type_: str = "", use: str = ""
) -> Role | None:
    """Return the lowest role that may do `what` with `name`; None: no role may. `type_` "" means any type."""
    roles = [
        Role(entry.role)
        for entry in allowed
        if (entry.what, entry.name, entry.use) == (what, name, use) and bare(type_) in ("", bare(entry.type))
    ]
    return min(roles, default=None)


def check_role(rights: Rights, needed: Role | None, name: str) -> Refusal | None:
    """Refuse the use of `name` unless these rights include the role `needed`."""
    if needed is None:
        text = say("{name} is not on the allow-list for this. Ask the staff.", name=name)
        return Refusal("not_allowed", text, "robot", {"name": name})
    if rights.role is None or rights.role < needed:
        text = say("{name} needs the role {role}. Ask the staff.", name=name, role=ROLES[needed])
        return Refusal("role_too_low", text, "account", {"name": name, "role": needed.value})
    return None
