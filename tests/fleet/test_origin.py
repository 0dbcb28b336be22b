"""The address of the console in links that others get: a Host header only chooses among its own names."""

from __future__ import annotations

from typing import Any

import pytest
from django.test import RequestFactory

from fleet.base.web.origin import PORT_HEADER, public_origin

HOSTS = ["localhost", "127.0.0.1", "fleet.lab.example", "192.168.1.20"]


@pytest.fixture(autouse=True)
def lab(settings: Any) -> None:
    settings.ALLOWED_HOSTS, settings.FLEET_ORIGINS, settings.FLEET_TLS = HOSTS, [], False


@pytest.mark.parametrize(
    "host", ["127.0.0.1:6666", "fleet.lab.example:22", "fleet.lab.example", "localhost:8000"]
)
def test_name_and_port_are_those_of_the_console(host: str) -> None:
    request = RequestFactory().get("/", headers={"host": host}, SERVER_PORT="8000")
    assert public_origin(request) == "http://fleet.lab.example:8000"


@pytest.mark.parametrize("host", ["192.168.1.20", "192.168.1.20:22"])
def test_readers_of_another_network_get_the_name_they_use(host: str) -> None:
    request = RequestFactory().get("/", headers={"host": host}, SERVER_PORT="8000")
    assert public_origin(request) == "http://192.168.1.20:8000"


def test_a_name_under_a_domain_is_none_of_the_list(settings: Any) -> None:
    settings.ALLOWED_HOSTS = [".lab.example", "fleet.lab.example"]
    request = RequestFactory().get("/", headers={"host": "evil.lab.example"}, SERVER_PORT="8000")
    assert public_origin(request) == "http://fleet.lab.example:8000"


def test_a_proxy_with_tls_has_the_usual_port(settings: Any) -> None:
    settings.FLEET_TLS = True
    request = RequestFactory().get("/", headers={"host": "fleet.lab.example:6666"}, SERVER_PORT="8000")
    assert public_origin(request) == "https://fleet.lab.example"


def test_an_origin_that_staff_entered_counts_first(settings: Any) -> None:
    settings.FLEET_TLS, settings.FLEET_ORIGINS = True, ["http://old.example", "https://fleet.example:8443"]
    assert public_origin(RequestFactory().get("/")) == "https://fleet.example:8443"


def test_the_pages_process_hears_the_port_from_the_web_process(monkeypatch: pytest.MonkeyPatch) -> None:
    forged = RequestFactory().get("/", headers={"host": "localhost", PORT_HEADER: "6666"}, SERVER_PORT="8000")
    assert public_origin(forged) == "http://fleet.lab.example:8000"
    monkeypatch.setenv("FLEET_PROGRAMS_SOCKET", "/run/x.sock")
    request = RequestFactory().get(
        "/", headers={"host": "localhost", PORT_HEADER: "8000"}, SERVER_PORT="unknown"
    )
    assert public_origin(request) == "http://fleet.lab.example:8000"


def test_a_console_of_one_computer_keeps_the_name_in_use(settings: Any) -> None:
    settings.ALLOWED_HOSTS = ["localhost", "127.0.0.1"]
    request = RequestFactory().get("/", headers={"host": "127.0.0.1:9"}, SERVER_PORT="8000")
    assert public_origin(request) == "http://127.0.0.1:8000"
