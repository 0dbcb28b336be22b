"""Describe a browser in plain words, so that people recognise their own. For display only."""

from __future__ import annotations

from django.utils.translation import gettext as _

# First match counts: most browsers also claim to be some of those that come after them.
BROWSERS = [
    ("Edg", "Edge"),
    ("OPR/", "Opera"),
    ("SamsungBrowser/", "Samsung Internet"),
    ("Firefox/", "Firefox"),
    ("FxiOS/", "Firefox"),
    ("CriOS/", "Chrome"),
    ("Chrome/", "Chrome"),
    ("Safari/", "Safari"),
    ("curl/", "curl"),
    ("python", "Python"),
]
SYSTEMS = [
    ("Android", "Android"),
    ("iPhone", "iPhone"),
    ("iPad", "iPad"),
    ("Windows", "Windows"),
    ("CrOS", "ChromeOS"),
    ("Mac OS X", "macOS"),
    ("Linux", "Linux"),
]


def device_of(user_agent: str) -> str:
    """Return text such as "Firefox on Linux", from a User-Agent header."""
    browser = next((name for token, name in BROWSERS if token in user_agent), _("Unknown browser"))
    system = next((name for token, name in SYSTEMS if token in user_agent), None)
    return _("%(browser)s on %(system)s") % {"browser": browser, "system": system} if system else browser
