"""Walk through pages like a person without a script: open links, fill fields, press buttons; each is an action."""

from __future__ import annotations

from dataclasses import dataclass, field
from html.parser import HTMLParser
from typing import Any
from urllib.parse import urljoin

from django.test import Client

VOID = {"input", "meta", "link", "img", "br", "hr", "source"}
SILENT = {"option", "textarea", "script", "style", "small"}  # their text is no part of a label


@dataclass
class Field:
    """A field of a form, or a button. `form`: the form's place in the page, or its id."""

    kind: str
    name: str
    value: Any
    form: int | str
    chosen: bool = True
    label: str = ""
    action: str | None = None


@dataclass
class Page(HTMLParser):
    """The links, forms, fields and buttons of a page."""

    links: list[tuple[str, str]] = field(default_factory=list)
    forms: list[dict[str, str | None]] = field(default_factory=list)
    fields: list[Field] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self._stack: list[str] = []
        self._form = -1
        self._named: list[
            tuple[str, list[str], list[Any]]
        ] = []  # open labels, links and buttons: tag, text, what for

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note a form, field, button, label or link."""
        have = dict(attrs)
        if tag not in VOID:
            self._stack.append(tag)
        if tag == "form":
            self._form = len(self.forms)
            self.forms.append(have)
        elif tag in ("input", "select", "textarea", "button"):
            self._field(tag, have)
        elif tag == "option":
            select = self.fields[-1]
            if "selected" in have or select.value is None:
                select.value = have.get("value")
        elif tag == "label":
            self._named.append((tag, [], []))
        elif tag == "a":
            self._named.append((tag, [], [have.get("href")]))

    def _field(self, tag: str, have: dict[str, str | None]) -> None:
        kind = have.get("type") or tag
        made = Field(
            kind=kind,
            name=have.get("name") or "",
            value=None if tag == "select" else (have.get("value") or ("on" if kind == "checkbox" else "")),
            form=have.get("form") or self._form,
            chosen=kind != "checkbox" or "checked" in have,
            action=have.get("formaction"),
        )
        self.fields.append(made)
        if tag == "button":
            self._named.append((tag, [], [made]))
        elif self._named and self._named[-1][0] == "label":
            self._named[-1][2].append(made)

    def handle_data(self, data: str) -> None:
        """Add to the name of the open label, link or button."""
        if self._stack and self._stack[-1] == "textarea":
            self.fields[-1].value += data
        if self._named and not SILENT & set(self._stack):
            self._named[-1][1].append(data)

    def handle_endtag(self, tag: str) -> None:
        """Close a form, label, link or button."""
        if tag in self._stack:
            while self._stack.pop() != tag:
                pass
        if tag == "form":
            self._form = -1
        if not self._named or self._named[-1][0] != tag:
            return
        _tag, texts, of = self._named.pop()
        name = " ".join("".join(texts).split())
        if tag == "a":
            self.links.append((name, of[0]))
        for one in of if tag != "a" else ():
            one.label = name

    def form_of(self, button: Field) -> tuple[int, dict[str, str | None]]:
        """Return the form that a button sends."""
        for place, form in enumerate(self.forms):
            if button.form in (place, form.get("id")):
                return place, form
        raise AssertionError(f"the button {button.label} is in no form")


class Walker:
    """A signed-in person who walks from page to page; `actions` counts per task."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.actions: dict[str, int] = {}
        self._task = ""

    def task(self, name: str, url: str = "/") -> None:
        """Begin a task, on the first page or another."""
        self._task = name
        self.actions[name] = 0
        self.go(url)

    def go(self, url: str) -> Walker:
        """Show a page. No action: the person is there."""
        self._show(self.client.get(url, follow=True), url)
        return self

    def open(self, name: str) -> None:
        """Open the first link whose name begins so."""
        self.actions[self._task] += 1
        found = [href for text, href in self.page.links if text.startswith(name) and href]
        assert found, f"{self._task}: no link {name} on {self.url}"
        self.go(urljoin(self.url, found[0]))

    def fill(self, label: str, value: Any) -> None:
        """Fill in or choose the value of a field."""
        self._found(label).value = value

    def tick(self, label: str) -> None:
        """Tick a box."""
        self._found(label).chosen = True

    def press(self, name: str) -> None:
        """Press the first button with this name: send its form."""
        button = self._found(name, "button")
        place, form = self.page.form_of(button)
        sent: dict[str, list[Any]] = {}
        for one in self.page.fields:
            of_form = one.form in (place, form.get("id"))
            if of_form and one.name and one.chosen and (one is button or one.kind != "button"):
                sent.setdefault(one.name, []).append(one.value)
        if sent.get("file") == [""]:
            del sent["file"]
        url = urljoin(self.url, button.action or form.get("action") or "")
        self._show(self.client.post(url, sent, follow=True), url)

    def press_script(self, key: str) -> None:
        """Press a button of a script."""
        self.actions[self._task] += 1
        assert f'id="{key}"' in self.text, f"{self._task}: no button {key} on {self.url}"

    def _found(self, label: str, kind: str = "") -> Field:
        self.actions[self._task] += 1
        for one in self.page.fields:
            if one.label.startswith(label) and (one.kind == "button") == (kind == "button"):
                return one
        named = [one.label for one in self.page.fields if one.label]
        raise AssertionError(f"{self._task}: no {kind or 'field'} {label} on {self.url}: {named}")

    def _show(self, answer: Any, url: str) -> None:
        chain = getattr(answer, "redirect_chain", ())
        self.url = chain[-1][0] if chain else url
        assert answer.status_code in (200, 409), f"{self._task}: {self.url} answered {answer.status_code}"
        self.answer, self.text = answer, ""
        if answer["Content-Type"].startswith("text/html"):
            self.text = answer.content.decode()
            self.page = Page()
            self.page.feed(self.text)
