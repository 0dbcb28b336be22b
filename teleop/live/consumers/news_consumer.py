"""The WebSocket of a page for its person's notifications: the unseen ones, at once when they change.

One reader looks for all pages of this web process, with two queries a second however many are open. So it does not
matter which process wrote a notification, and a page that connects again has missed nothing.
"""

from __future__ import annotations

from collections.abc import Collection
from uuid import UUID

from django.utils import timezone

from fleet.accounts.selectors import signed_in
from fleet.bookings.messages.notifications import notifications_unseen
from robots.shared import wire
from teleop.background.database import in_database
from teleop.control.selectors import SIGNED_OUT, SignIn
from teleop.live.consumers.listening import ListeningSocket, SharedReader
from teleop.live.consumers.message_socket import CloseCode


class NewsConsumer(ListeningSocket):
    """One page. It gets the list when it opens, and whenever it changes."""

    shown: wire.News | None = None  # what the page has

    async def on_open(self) -> None:
        if "token" in self.scope:
            await self.close(CloseCode.NOT_PERMITTED, "Notifications are for people: sign in on a page.")
            return
        self.person: SignIn = (UUID(str(self.scope["user"].pk)), self.scope["session"].session_key or "")
        _reader.join(self)

    async def on_close(self) -> None:
        _reader.leave(self)

    async def show(self, news: wire.News | None) -> None:
        """Send the list if it is new to the page. None: the sign-in ended."""
        if news is None:
            await self.close(CloseCode.SIGNED_OUT, SIGNED_OUT.text)
        elif news != self.shown:
            self.shown = news
            await self.send_message(news)


class _Reader(SharedReader[NewsConsumer]):
    check_s = 1.0
    failed = "Pages get no notifications now"

    async def look(self) -> None:
        pages = list(self.pages)
        found = await in_database(_news_of, {page.person for page in pages})
        for page in pages:
            await page.show(found.get(page.person))


def _news_of(people: Collection[SignIn]) -> dict[SignIn, wire.News]:
    """Return the unseen notifications of each sign-in that is still valid."""
    users = signed_in(people)
    now = timezone.now()
    unseen = notifications_unseen({user.pk for user in users.values()}, now)
    return {
        person: wire.News(
            [
                wire.NewsItem(one.pk, one.subject, one.text, one.path, one.until is not None)
                for one in unseen[user.pk]
            ]
        )
        for person, user in users.items()
    }


_reader = _Reader()
