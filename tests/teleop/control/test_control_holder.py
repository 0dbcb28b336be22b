"""Control of a robot without a WebSocket."""

import asyncio
import time
from contextlib import asynccontextmanager
from uuid import uuid4

import pytest
from django.conf import settings
from django.utils import timezone

from fleet.accounts.models import User
from robots.shared import wire
from teleop.background.database import in_database
from teleop.control import services
from teleop.control.lease_checks import Tab, fingerprint
from teleop.control.selectors import lease_of, rights_of, robot_entry
from teleop.live import robot_hub
from teleop.live.control_holder import ControlHolder
from teleop.live.grant_renewal import Delays
from tests.teleop.support import TIMEOUT_S

pytestmark = pytest.mark.django_db(transaction=True)


class Program:
    """A program that controls a robot: a member of the robot's hub that owns a ControlHolder."""

    wants_views = False
    draws_joints = False
    checked_often = True

    def __init__(self, user, session_key):
        self.id = uuid4().hex
        self.user, self.person, self.name = user, (user.id, session_key), user.display_name
        self.reports = asyncio.Queue()
        self.heard_s = time.monotonic()
        self.control = None

    async def open(self, robot):
        entry = await in_database(robot_entry, robot.id)
        self.rights = (await in_database(rights_of, [self.person], robot, timezone.now()))[self.person]
        self.hub = robot_hub.join(robot.id, entry, self)
        tab = Tab("program-0123456789", fingerprint(self.person[1]), self.id)
        self.control = ControlHolder(self.hub, self.user.id, tab, report=self.reports.put, delays=Delays)
        await self.hub.wait_for_link()

    async def close(self):
        await self.control.leave()
        await self.hub.remove(self)

    async def hears(self, kind, **fields):
        """Return the next report of this kind with these fields."""
        while True:
            report = await asyncio.wait_for(self.reports.get(), TIMEOUT_S)
            if isinstance(report, kind) and all(
                getattr(report, name) == value for name, value in fields.items()
            ):
                return report

    @property
    def held_session(self):
        return self.control.session if self.control else None

    async def follow(self, status):
        self.rights = status.rights.get(self.person, self.rights)
        if self.control:
            await self.control.follow(status, self.rights)

    async def robot_edited(self, entry): ...

    def link_changed(self, up, refusal):
        if up and self.control:
            self.control.renew_soon()

    def offers_changed(self, offers): ...

    def path_changed(self, path): ...

    def ended_at_bridge(self, ended): ...

    def refused_at_bridge(self, refused): ...


@pytest.fixture
def program(robot, browsers, bridge):
    """`async with program("operator")`: that person's program, which follows `robot`."""

    @asynccontextmanager
    async def opened(who):
        session_key = browsers[who].cookies[settings.SESSION_COOKIE_NAME].value
        user = await in_database(User.objects.get, username=who)
        one = Program(user, session_key)
        await one.open(robot)
        try:
            yield one
        finally:
            await one.close()

    return opened


async def test_program_takes_renews_and_releases_control(program, bridge, robot):
    async with program("operator") as one:
        await one.control.take_control()
        mine = await one.hears(wire.Control, state="yours")
        grant = await bridge.hears(wire.Grant)
        assert one.control.fence == mine.fence == grant.fence
        await bridge.hears(wire.Grant, lambda grant: grant.fence == mine.fence, count=2)
        await one.control.release()
        await bridge.hears(wire.Revoke, lambda revoke: revoke.fence == mine.fence)
        await one.hears(wire.Control, state="free")
        assert one.control.fence is None
        assert await in_database(lease_of, robot.id) is None


async def test_program_hands_control_over_to_another(program, bridge):
    async with program("operator") as one, program("second") as other:
        await one.control.take_control()
        first = await one.hears(wire.Control, state="yours")
        with pytest.raises(services.ControlRefused):
            await other.control.take_control()
        await other.control.ask()
        request = (await one.hears(wire.Control, state="yours")).requests[0]
        await one.hears(wire.Notice, code="asked")
        await one.control.hand_over(request.number)
        await one.hears(wire.Notice, code="handed_over")
        assert (await other.hears(wire.Control, state="yours")).fence > first.fence
        assert one.control.fence is None


async def test_program_loses_control_with_its_role(program, bridge, robot):
    async with program("operator") as one:
        await one.control.take_control()
        fence = (await one.hears(wire.Control, state="yours")).fence
        await in_database(robot.roles.filter(user=one.user).update, role="observer")
        await one.hears(wire.Notice, code="role_too_low")
        await bridge.hears(wire.Revoke, lambda revoke: revoke.fence == fence)
        assert one.control.fence is None
