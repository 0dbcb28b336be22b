"""The pages of docs/ as HTML: found by name and rendered once. Links between them lead to pages of help.

A translation of a page has the same name in the folder of its language, such as "es/student".
"""

from __future__ import annotations

import hashlib
import posixpath
import re
from functools import cache
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

from django.conf import settings
from django.conf.locale import LANG_INFO
from django.urls import reverse
from markdown_it import MarkdownIt
from markdown_it.token import Token

DOCS: Path = settings.BASE_DIR / "docs"
PICTURES = {".png": "image/png", ".svg": "image/svg+xml"}
ENGLISH = "en/"  # in URLs, before the name of a page
INDEX = "README"  # the first page of each folder; its URL is that of the folder


_MARKDOWN = MarkdownIt("commonmark", {"html": False}).enable("table")


class Page(NamedTuple):
    """A rendered page: its title, its body as HTML, and the code of its language."""

    title: str
    body: str
    language: str


@cache
def known() -> frozenset[str]:
    """Return the names of all pages, as in URLs, such as "decisions/control-follows-the-lease"."""
    return frozenset(str(path.relative_to(DOCS).with_suffix("")) for path in DOCS.rglob("*.md"))


def meant(name: str, language: str) -> str | None:
    """Return the page that a URL names, in this language if it is translated; None: there is no such page.

    A name that begins with `ENGLISH` is the English page, also where it is translated.
    """
    asked = name.removeprefix(ENGLISH)
    found = next((one for one in (asked, f"{asked}/{INDEX}".lstrip("/")) if one in known()), None)
    translated = f"{language}/{found}"
    return translated if asked == name and translated in known() else found


@cache
def pictures() -> frozenset[str]:
    """Return the file names of all pictures."""
    return frozenset(path.name for path in (DOCS / "img").iterdir() if path.suffix in PICTURES)


def drawings(name: str) -> dict[str, str]:
    """Return the Mermaid sources in a page, by the file names of the drawings that script/drawings makes."""
    return {_drawing(name, token.content): token.content for token in _parsed(name) if _is_source(token)}


@cache
def page(name: str) -> Page:
    """Return the page with this name, which is one of `known`."""
    tokens = _parsed(name)
    title = name
    for at, token in enumerate(tokens):
        if token.type == "heading_open":
            words = _words(tokens[at + 1])
            token.attrSet("id", _anchor(words))
            title = words if token.tag == "h1" else title
        _lead(token, posixpath.dirname(name))
    tokens = _scrolling(_drawn(tokens, name))
    return Page(title, _MARKDOWN.renderer.render(tokens, _MARKDOWN.options, {}), _language(name))


@cache
def sections(name: str) -> dict[str, str]:
    """Return the parts of a page by the names of their headings (level 2) in links, as HTML."""
    found: dict[str, list[Token]] = {}
    part: list[Token] = []
    for token in _parsed(name):
        if token.type == "heading_open" and token.tag == "h2":
            part = []
        if token.type == "inline" and not part[1:] and part and part[0].tag == "h2":
            found[_anchor(_words(token))] = part
        _lead(token, posixpath.dirname(name))
        part.append(token)
    return {
        anchor: _MARKDOWN.renderer.render(tokens, _MARKDOWN.options, {}) for anchor, tokens in found.items()
    }


def _language(name: str) -> str:
    folder = name.partition("/")[0]
    return folder if folder in LANG_INFO else "en"


def _parsed(name: str) -> list[Token]:
    return _MARKDOWN.parse((DOCS / f"{name}.md").read_text(encoding="utf-8"))


def _words(inline: Token) -> str:
    """Return a heading's text without its markup."""
    return "".join(child.content for child in inline.children or [])


def _anchor(heading: str) -> str:
    """Return the name of a heading in links, as GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def _lead(token: Token, folder: str) -> None:
    """Rewrite the URLs below a token: links between pages stay links; links out of docs/ become text."""
    closing = 0
    for child in token.children or []:
        if child.type == "image":
            child.attrSet("src", reverse("help-picture", args=[posixpath.basename(str(child.attrs["src"]))]))
        elif child.type == "link_open":
            target = _address(str(child.attrs["href"]), folder)
            if target is None:
                child.tag, child.attrs = "span", {}
                closing += 1
            else:
                child.attrSet("href", target)
        elif child.type == "link_close" and closing:
            child.tag = "span"
            closing -= 1


def _address(target: str, folder: str) -> str | None:
    """Return the URL here for a link of a page in `folder`; None if its target is not a page of help."""
    parts = urlsplit(target)
    if parts.scheme or not parts.path:
        return target
    path = posixpath.normpath(posixpath.join(folder, parts.path))
    name = path.removesuffix(".md") if path.endswith(".md") else posixpath.join(path, INDEX)
    if name not in known():
        return None
    shown = ENGLISH + name if f"{folder}/{name}" in known() else name  # a translation names its original
    return address_of(shown) + (f"#{parts.fragment}" if parts.fragment else "")


def address_of(name: str) -> str:
    """Return a page's URL. For the `INDEX` of a folder, it is the folder's URL."""
    shown = posixpath.dirname(name) if posixpath.basename(name) == INDEX else name
    return reverse("help-page", args=[shown]) if shown else reverse("help")


def _is_source(token: Token) -> bool:
    return token.type == "fence" and token.info == "mermaid"


def _drawing(name: str, source: str) -> str:
    """Return the file name of a drawing. It changes with the source, so that no page shows an old drawing."""
    return f"{posixpath.basename(name)}-{hashlib.sha256(source.encode()).hexdigest()[:12]}.svg"


def _drawn(tokens: list[Token], name: str) -> list[Token]:
    """Replace the sources by their drawings. A source without a drawing stays as text."""
    return [_image(token, name) if _is_source(token) else token for token in tokens]


def _image(source: Token, name: str) -> Token:
    file = _drawing(name, source.content)
    if file not in pictures():
        return source
    said = re.search(r"^ *accDescr: (.+)$", source.content, re.MULTILINE)
    attrs = {"class": "drawing", "src": reverse("help-picture", args=[file]), "alt": said[1] if said else ""}
    return Token("drawing", "img", 0, attrs=attrs)


def _scrolling(tokens: list[Token]) -> list[Token]:
    """Put each table and drawing into a box that scrolls, so that a phone's page does not scroll sideways."""
    boxed: list[Token] = []
    for token in tokens:
        if token.type in ("table_open", "drawing"):
            boxed.append(Token("box_open", "div", 1, attrs={"class": "table-scroll", "tabindex": "0"}))
        boxed.append(token)
        if token.type in ("table_close", "drawing"):
            boxed.append(Token("box_close", "div", -1))
    return boxed
