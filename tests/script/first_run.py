"""The first-run pages, as the browser of an administrator fills them in."""

from __future__ import annotations

import re
import urllib.parse
import urllib.request
from html.parser import HTMLParser

from script.stack.stack import Account

PAGE_S = 120.0  # a busy computer


class Form(HTMLParser):
    """The fields and values of a page's forms, as a browser sends them."""

    def __init__(self) -> None:
        super().__init__()
        self.fields: dict[str, str] = {}
        self.options: dict[str, str] = {}  # shown text -> sent value
        self._text_of = self._option = ""

    @classmethod
    def of(cls, page: str) -> Form:
        form = cls()
        form.feed(page)
        return form

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        name = given.get("name", "")
        if tag == "input" and name and given.get("type") not in ("submit", "checkbox"):
            self.fields[name] = given.get("value", "")
        elif tag == "input" and given.get("type") == "checkbox" and "checked" in given:
            self.fields[name] = "on"
        elif tag == "textarea":
            self._text_of = name
            self.fields[name] = ""
        elif tag == "select":
            self._select = name
        elif tag == "option":
            self._option = given.get("value", "")
            if "selected" in given:
                self.fields[self._select] = self._option

    def handle_data(self, data: str) -> None:
        if self._text_of:
            self.fields[self._text_of] += data
        elif self._option:
            self.options[data.strip()] = self._option

    def handle_endtag(self, tag: str) -> None:
        if tag == "textarea":
            self._text_of = ""
        elif tag == "option":
            self._option = ""


def set_up(log: str, staff: Account, robot: str, master_uri: str) -> str:
    """Open the address that the console printed, and make the first admin and the first robot on its pages.

    Return the page with the checks of the robot.
    """
    [address], [code] = (
        re.findall(r"Set the console up at (\S+)", log),
        re.findall(r"One-time code: (\S+)", log),
    )
    browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())

    def submit(url: str, **filled: str) -> tuple[str, str]:
        with browser.open(url, timeout=PAGE_S) as page:
            form = Form.of(page.read().decode())
        filled = {name: form.options.get(value, value) for name, value in filled.items()}
        body = urllib.parse.urlencode(form.fields | filled).encode()
        with browser.open(urllib.request.Request(url, body, {"Referer": url}), timeout=PAGE_S) as page:  # noqa: S310
            return page.url, page.read().decode()

    password = {"password1": staff.password, "password2": staff.password}
    robots, _page = submit(address, code=code, username=staff.username, **password)
    assert robots == f"{address}robot/"
    checks, page = submit(robots, name=robot, profile="PAL TIAGo", master_uri=master_uri)
    assert checks.startswith(robots) and checks != robots
    return page
