"""Helpers for tests with a real web process: its environment and its database."""

import subprocess
import sys

from tests.conftest import PASSWORD
from tests.processes import REPOSITORY, outside


def console_environment(folder, host, **settings):
    """Environment of a console with its data in `folder`. Debug mode avoids collecting static files."""
    return {
        **outside(),
        "FLEET_VAR": str(folder / "var"),
        "FLEET_SECRET_KEY": "k" * 50,
        "FLEET_HOSTS": host,
        "FLEET_DEBUG": "1",
        **settings,
    }


def create_database(environ):
    """Migrate a new database and create one account, "first"."""
    manage = [sys.executable, "manage.py"]
    account = ["createsuperuser", "--no-input", "--username", "first", "--email", "", "--verbosity", "0"]
    with_password = {**environ, "DJANGO_SUPERUSER_PASSWORD": PASSWORD}
    subprocess.run([*manage, "migrate", "--verbosity", "0"], cwd=REPOSITORY, env=environ, check=True)
    subprocess.run([*manage, *account], cwd=REPOSITORY, env=with_password, check=True)
