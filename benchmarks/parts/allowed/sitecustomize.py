"""Python runs this first in each process of a stack that may take real-time priority (`benchmarks.parts.priority`)."""

import resource

_getrlimit, _setrlimit = resource.getrlimit, resource.setrlimit
_allowed = (10, 10)


def getrlimit(which: int) -> tuple[int, int]:
    """Return the service unit's limit for real-time priority; for all other resources the real limit."""
    return _allowed if which == resource.RLIMIT_RTPRIO else _getrlimit(which)


def setrlimit(which: int, limits: tuple[int, int]) -> None:
    """Set a limit; the limit of real-time priority is only stored here."""
    global _allowed
    if which == resource.RLIMIT_RTPRIO:
        _allowed = limits
    else:
        _setrlimit(which, limits)


resource.getrlimit, resource.setrlimit = getrlimit, setrlimit
