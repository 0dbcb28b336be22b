"""Log messages for the administrator."""

from __future__ import annotations

import logging

import pytest
from django.test import Client


@pytest.mark.django_db
def test_an_unknown_host_is_one_line_that_names_our_setting() -> None:
    lines: list[logging.LogRecord] = []
    heard = logging.Handler()
    heard.emit = lines.append  # type: ignore[method-assign]
    logger = logging.getLogger("django.security.DisallowedHost")
    logger.addHandler(heard)
    try:
        assert Client().get("/", headers={"host": "fleet.example"}).status_code == 400
    finally:
        logger.removeHandler(heard)
    [line] = lines
    assert (
        line.getMessage()
        == "Invalid HTTP_HOST header: 'fleet.example'. You may need to add 'fleet.example' to FLEET_HOSTS."
    )
    assert line.exc_info is None
