"""Who acts where nobody is signed in: the account of this computer that runs the process."""

from __future__ import annotations

import os
import pwd

from fleet.audit import SystemAccount


def here() -> SystemAccount:
    """Who runs this process."""
    try:
        return SystemAccount(pwd.getpwuid(os.getuid()).pw_name)
    except KeyError:  # a container's number without a name
        return SystemAccount(str(os.getuid()))
