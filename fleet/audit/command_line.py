"""The actor where nobody is signed in: the computer account that runs the process."""

from __future__ import annotations

import os
import pwd
from typing import NamedTuple


class SystemAccount(NamedTuple):
    """A person at the command line of this computer, known only by the computer account."""

    name: str


def here() -> SystemAccount:
    """Return the computer account that runs this process."""
    try:
        return SystemAccount(pwd.getpwuid(os.getuid()).pw_name)
    except KeyError:  # in a container, a user number may have no name
        return SystemAccount(str(os.getuid()))
