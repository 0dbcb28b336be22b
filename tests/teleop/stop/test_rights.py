"""The right to stop robots is read for many requests together."""

import asyncio
import threading

from fleet.server.credentials import Credential
from teleop.stop.rights import Rights


async def test_a_request_that_is_cancelled_takes_no_answer_from_others():
    may_read = threading.Event()

    def read(asked):
        may_read.wait()
        return {}

    rights, session = Rights(read), Credential("session")
    leaves, waits = (asyncio.ensure_future(_asked(rights, session)) for _ in range(2))
    await asyncio.sleep(0)
    leaves.cancel()
    await asyncio.sleep(0)
    may_read.set()
    assert await waits is None
    assert await _asked(rights, session) is None  # and it is read again for those who come later


async def _asked(rights: Rights, credential: Credential):
    return await rights.ask(credential)
