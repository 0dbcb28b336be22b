"""Describe a browser in plain words, so that people recognise their own browser. For display only."""

from __future__ import annotations

from django.utils.translation import gettext as _

# The first match counts: the header of most browsers also contains names that come later in this list.
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
