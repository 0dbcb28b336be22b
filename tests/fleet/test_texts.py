"""What pages tell without anybody signed in: the texts of their scripts, and which cookies there are."""

from __future__ import annotations

import pytest
from django.conf import settings
from django.test import Client


def test_the_texts_of_scripts_are_a_script_for_everybody() -> None:
    answer = Client().get("/texts.js")
    assert answer.status_code == 200
    assert answer["Content-Type"].startswith("text/javascript")
    assert b"gettext" in answer.content


@pytest.mark.django_db
def test_the_cookie_page_names_both_cookies() -> None:
    page = Client().get("/cookies/").content.decode()
    assert settings.SESSION_COOKIE_NAME in page
    assert settings.CSRF_COOKIE_NAME in page
