"""docs/webhooks.md: its program accepts our events and no others; its tables are complete."""

import re
import time
from pathlib import Path

import pytest

from teleop.webhooks import addresses, delivery, post
from teleop.webhooks.delivery import send_due
from teleop.webhooks.events import EVENT_CATEGORIES
from teleop.webhooks.services import webhook_test

PAGE = Path(__file__).parents[3] / "docs/webhooks.md"


@pytest.mark.django_db
def test_the_program_of_the_docs_checks_signatures(make, receiver, staff, monkeypatch):
    program: dict = {}
    exec(re.search(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)[1], program)  # noqa: S102
    is_genuine = program["is_genuine"]
    webhook = make(receiver.address)
    webhook_test(webhook=webhook, actor=staff)
    send_due(webhook.pk)
    [(_path, headers, body)] = receiver.heard
    assert is_genuine(make.secret, headers, body)
    assert is_genuine(
        make.secret, {**headers, "webhook-signature": f"v1,x {headers['webhook-signature']}"}, body
    )
    assert not is_genuine(make.secret, headers, body + b" ")
    assert not is_genuine(make.secret, {**headers, "webhook-id": "rec_1"}, body)
    assert not is_genuine("whsec_" + "A" * 44, headers, body)
    monkeypatch.setattr(time, "time", lambda: int(headers["webhook-timestamp"]) + 301)
    assert not is_genuine(make.secret, headers, body)


def test_the_docs_name_every_event_and_every_code():
    page = PAGE.read_text()
    kinds = {kind for category in EVENT_CATEGORIES.values() for kind in category.kinds}
    assert [
        kind for kind in kinds if f"`{kind}`" not in page and f"`.{kind.split('.')[1]}`" not in page
    ] == []
    for module in (addresses, delivery, post):
        codes = re.findall(
            r'(?:AddressRefused|NotSent)\(\s*"(\w+)"|"code": "(\w+)"', Path(module.__file__).read_text()
        )
        assert [code for pair in codes for code in pair if code and f"`{code}`" not in page] == []
