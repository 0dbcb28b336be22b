"""Request ids: of answers, and of connections, which begin with them and are never equal."""

import pytest
from django.test import Client

from fleet.base.web.request_ids import connection_id, request_id


def test_an_id_of_a_client_is_kept_if_it_is_one():
    assert request_id("night-42") == "night-42"
    assert len({request_id(given) for given in (None, "", "a b", "a" * 65)}) == 4


def test_connections_of_one_request_are_told_apart():
    headers = [(b"host", b"localhost"), (b"x-request-id", b"night-42")]
    first, second = connection_id(headers), connection_id(headers)
    assert first.startswith("night-42-") and second.startswith("night-42-") and first != second
    assert len(connection_id([(b"x-request-id", b"a" * 64)])) <= 64


@pytest.mark.django_db
def test_each_page_has_an_id(client: Client):
    assert client.get("/livez", headers={"X-Request-ID": "night-43"})["X-Request-ID"] == "night-43"
