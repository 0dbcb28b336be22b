"""Serve the Lichtblick build that `FLEET_LICHTBLICK` names, at /lichtblick/.

It comes from the console's own origin, but is not the console's code. Its policy lets it load its own files and open
the Foxglove door, and nothing else: it cannot use the session of the person who opened it, open other pages of the
console, or reach other servers.
"""

from __future__ import annotations

import os
import re
from base64 import b64encode
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

from django.conf import settings
from django.http import Http404, HttpRequest, HttpResponseBase
from django.views.decorators.http import require_safe
from whitenoise.base import WhiteNoise
from whitenoise.middleware import WhiteNoiseMiddleware

AT, DOOR = "/lichtblick/", "/foxglove/"
_HASHED = re.compile(r"[/.][0-9a-f]{16,64}\.")  # the name changes with the content
_INLINE = re.compile(rb"<script>(.*?)</script>", re.DOTALL)


class Build(WhiteNoise):  # type: ignore[misc]  # WhiteNoise is untyped
    """The files of a build, listed once: another path reaches no file, and a symbolic link is none of them."""

    def __init__(self, folder: Path) -> None:
        super().__init__(None, autorefresh=False, max_age=0, allow_all_origins=False, index_file=True)
        for root, _, names in os.walk(folder):
            for file in (Path(root, name) for name in names):
                if file.is_file() and not file.is_symlink():
                    self.add_file_to_dictionary(AT + file.relative_to(folder).as_posix(), str(file))
        inline = _INLINE.findall((folder / "index.html").read_bytes())
        self.inline = [f"'sha256-{b64encode(sha256(script).digest()).decode()}'" for script in inline]

    def immutable_file_test(self, _path: str, url: str) -> bool:
        """Return whether a browser may keep the file for ever."""
        return _HASHED.search(url) is not None


@require_safe
def lichtblick(request: HttpRequest, file: str = "") -> HttpResponseBase:
    """Send a file of the build; without a name, its page."""
    build = _build(settings.FLEET_LICHTBLICK) if settings.FLEET_LICHTBLICK else None
    if build is None or AT + file not in build.files:
        raise Http404
    response: HttpResponseBase = WhiteNoiseMiddleware.serve(build.files[AT + file], request)
    response["Content-Security-Policy"] = _policy(request.get_host(), build.inline)
    return response


@lru_cache(maxsize=1)
def _build(folder: Path) -> Build:
    return Build(folder)


def _policy(host: str, inline: list[str]) -> str:
    secure = "s" if settings.FLEET_TLS else ""
    files, door = f"http{secure}://{host}{AT}", f"ws{secure}://{host}{DOOR}"
    directives = {
        "default-src": "'none'",
        # Its readers of messages are functions that it writes itself
        "script-src": " ".join([files, "blob:", "'unsafe-eval'", *inline]),
        "worker-src": f"{files} blob:",
        "style-src": f"{files} 'unsafe-inline'",
        "img-src": f"{files} data: blob:",
        "media-src": "blob:",
        "font-src": f"{files} data:",
        "connect-src": f"{files} {door} data: blob:",
        "form-action": "'none'",
        "base-uri": "'none'",
        "frame-ancestors": "'none'",
        # Without pop-ups, because a script may use the other windows of its origin
        "sandbox": "allow-scripts allow-same-origin allow-forms allow-downloads allow-modals",
    }
    return "; ".join(f"{name} {value}" for name, value in directives.items())
