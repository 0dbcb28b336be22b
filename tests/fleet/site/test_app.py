"""The console as an installed app: manifest, icons, service worker."""

from __future__ import annotations

import json
import re
import struct

import pytest
from django.contrib.staticfiles import finders
from django.test import Client

pytestmark = pytest.mark.django_db


def test_the_manifest_names_icons_of_the_size_that_they_have(client: Client) -> None:
    answer = client.get("/manifest.webmanifest")
    assert answer.headers["Content-Type"] == "application/manifest+json"
    manifest = json.loads(answer.content)
    assert manifest["display"] == "standalone"
    pngs = [icon for icon in manifest["icons"] if icon["type"] == "image/png"]
    assert {icon["sizes"] for icon in pngs} >= {"192x192", "512x512"}
    for icon in pngs:
        found = finders.find(icon["src"].removeprefix("/static/"))
        with open(found, "rb") as file:
            width, height = struct.unpack(">II", file.read(24)[16:24])
        assert icon["sizes"] == f"{width}x{height}"


def test_the_worker_keeps_the_offline_page_and_its_files_only(client: Client) -> None:
    worker = client.get("/service-worker.js")
    assert worker.headers["Content-Type"] == "text/javascript"
    assert worker.headers["Cache-Control"] == "no-cache"
    [listed] = re.findall(r"const OFFLINE = (\[.*?\]);", worker.content.decode())
    files = json.loads(listed)
    assert files[0] == "/offline/"
    page = client.get("/offline/").content.decode()
    needed = re.findall(r'(?:href|src)="(/[^"]+)"', page)
    assert set(needed) == set(files[1:])


def test_every_page_leads_to_manifest_and_worker(client: Client) -> None:
    page = client.get("/accounts/sign-in/").content.decode()
    assert 'rel="manifest" href="/manifest.webmanifest" data-service-worker="/service-worker.js"' in page
    assert "manifest-src 'self'" in client.get("/accounts/sign-in/").headers["Content-Security-Policy"]
