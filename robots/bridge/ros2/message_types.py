"""Classes of message types by their names."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

from robots.shared.processes.probe_findings import FEEDBACK
from robots.shared.sentences import say


class TypeUnknown(Exception):
    """The package of a type is not on this computer, or has no such type: a sentence says so."""


@cache
def message_class(name: str) -> type[Any]:
    """Return the class of a message type such as "geometry_msgs/msg/Twist", or of what an action tells of its goals."""
    package, _, kind = name.partition("/")
    folder, _, kind = kind.rpartition("/")
    try:
        within = import_module(f"{package}.{folder or 'msg'}")
        if folder == "action" and kind.endswith(FEEDBACK):
            found: type[Any] = getattr(within, kind.removesuffix(FEEDBACK)).Impl.FeedbackMessage
        else:
            found = getattr(within, kind)
    except (ImportError, AttributeError) as error:
        raise TypeUnknown(say("No installed package has the type {type}.", type=name)) from error
    return found
