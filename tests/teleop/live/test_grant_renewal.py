"""Grants are renewed in time, and at once when something changed."""

import asyncio
from datetime import timedelta
from types import SimpleNamespace
from uuid import uuid4

from django.utils import timezone

from teleop.live import grant_renewal
from teleop.live.grant_renewal import Delays, GrantRenewer
from tests.teleop.support import TIMEOUT_S


class Link:
    """A bridge that answers a grant when the test lets it."""

    def __init__(self):
        self.grants = asyncio.Queue()
        self.answers = asyncio.Semaphore(0)

    def send(self, message):
        """Accept a message without an answer."""

    async def grant(self, grant):
        self.grants.put_nowait(grant)
        await self.answers.acquire()


async def test_a_change_during_a_renewal_is_sent_right_after_it(monkeypatch):
    monkeypatch.setattr(grant_renewal, "RENEW_S", 60.0)
    link, camera_s = Link(), [0.1]

    async def nothing(*_):
        """Ignore an answer."""

    renewer = GrantRenewer(
        SimpleNamespace(link=link, confirmed_s=float("inf"), robot_id=uuid4()),
        SimpleNamespace(
            fence=1,
            session=uuid4(),
            user=uuid4(),
            name="Ada",
            term_ends_at=timezone.now() + timedelta(minutes=5),
        ),
        permit=SimpleNamespace(max_share=1.0),
        answered=nothing,
        refused=nothing,
        delays=lambda: Delays(camera_s=camera_s[0]),
    )
    first = await asyncio.wait_for(link.grants.get(), TIMEOUT_S)
    camera_s[0] = 0.9
    renewer.renew_soon()
    link.answers.release()
    second = await asyncio.wait_for(link.grants.get(), TIMEOUT_S)
    assert (first.camera_s, second.camera_s) == (0.1, 0.9)
    renewer.revoke("The test is over.")
