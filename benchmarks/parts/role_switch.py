"""Give the observer a role on a robot, and take it away, in a separate process."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from subprocess import PIPE

from script.stack.places import REPOSITORY
from script.stack.stack import Stack

_CODE = """
import sys, time
from fleet.accounts.models import User
from fleet.audit.command_line import here
from robots.access.services import role_set
from robots.registry.models import Robot, Role
person, robot = User.objects.get(username="observer"), Robot.objects.get(slug={slug!r})
for line in sys.stdin:
    role = Role(line.strip()) if line.strip() else None
    role_set(robot=robot, user=person, role=role, actor=here())
    print(time.monotonic(), flush=True)
"""

Switch = Callable[[str], Awaitable[float]]


@asynccontextmanager
async def role_switch(stack: Stack, slug: str) -> AsyncIterator[Switch]:
    """Context: a function that sets the observer's role ("": none) and returns the time of the commit."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "manage.py", "shell", "-c", _CODE.format(slug=slug)),
        cwd=REPOSITORY,
        env=stack.environment,
        stdin=PIPE,
        stdout=PIPE,
    )
    assert process.stdin and process.stdout  # noqa: S101 - we asked for pipes

    async def switch(role: str) -> float:
        assert process.stdin and process.stdout  # noqa: S101 - as above
        process.stdin.write(f"{role}\n".encode())
        while True:
            line = await process.stdout.readline()
            try:
                return float(line)
            except ValueError:
                if not line:
                    raise RuntimeError("The role was not set.") from None

    try:
        yield switch
    finally:
        process.stdin.close()
        await process.wait()
