"""Helpers for tests of the web process: environment and database of a real one, and WebSockets without one."""

import subprocess
import sys
from pathlib import Path

from channels.testing import WebsocketCommunicator

from script.stack.database import NAME, new_database
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


def empty_database(environ):
    """Make a migrated database without rows of people and robots."""
    folder = Path(environ["FLEET_VAR"])
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    new_database(folder / NAME)


def create_database(environ):
    """Make a database with one account, "first"."""
    empty_database(environ)
    manage = [sys.executable, "manage.py"]
    account = ["createsuperuser", "--no-input", "--username", "first", "--email", "", "--verbosity", "0"]
    with_password = {**environ, "DJANGO_SUPERUSER_PASSWORD": PASSWORD}
    subprocess.run([*manage, *account], cwd=REPOSITORY, env=with_password, check=True)


async def websocket_answer(app, path, headers):
    """Open a WebSocket; return the server's first event after the handshake."""
    socket = WebsocketCommunicator(app, path, headers=list(headers.items()))
    await socket.send_input({"type": "websocket.connect"})
    answer = await socket.receive_output()
    if answer["type"] == "websocket.accept":
        answer = await socket.receive_output()
        await socket.send_input({"type": "websocket.disconnect", "code": 1000})
    await socket.wait()
    return answer
