"""The actor where nobody is signed in: the computer account that runs the process."""

from __future__ import annotations

import os
import pwd
from typing import NamedTuple


class SystemAccount(NamedTuple):
    """A person at the command line of this computer, who has no other name."""

    name: str


def here() -> SystemAccount:
    """The account that runs this process."""
    try:
        return SystemAccount(pwd.getpwuid(os.getuid()).pw_name)
    except KeyError:  # a container's number without a name
        return SystemAccount(str(os.getuid()))
