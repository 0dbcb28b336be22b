"""Why a bridge is not running: files beside the socket on which it listens.

A bridge that ends by itself leaves its last words; the supervisor takes them, and tells web processes the reason.
"""

from __future__ import annotations

import json
import logging
from contextlib import suppress
from pathlib import Path

from robots.shared.sentences import Sentence, of_parts

LONGEST = 400  # characters
LAST, WHY = ".last", ".why"  # of the bridge; of the supervisor

log = logging.getLogger(__name__)


def write(socket: str | Path, kind: str, words: str) -> None:
    """Write the file of this kind beside the socket. A full disk loses the words only."""
    parts = words.parts if isinstance(words, Sentence) and len(words) <= LONGEST else []
    file = _file(socket, kind)
    draft = file.with_suffix(f"{kind}-draft")
    try:
        draft.write_text(json.dumps([words[:LONGEST].strip(), parts], ensure_ascii=False), errors="replace")
        draft.replace(file)
    except OSError as error:
        log.warning("%s cannot be written: %s", file, error)


def read(socket: str | Path, kind: str) -> str:
    """Return the words of this kind; empty if there are none."""
    try:
        written = _file(socket, kind).read_text(errors="replace")
    except OSError:
        return ""
    try:
        text, parts = json.loads(written)
    except (ValueError, TypeError):  # the version before wrote plain text
        return written[:LONGEST].strip()
    return of_parts(text, parts) if parts else str(text)


def pop(socket: str | Path, kind: str) -> str:
    """Return the words of this kind, and remove them."""
    words = read(socket, kind)
    clear(socket, kind)
    return words


def clear(socket: str | Path, kind: str) -> None:
    """Remove the words of this kind."""
    with suppress(OSError):
        _file(socket, kind).unlink(missing_ok=True)


def _file(socket: str | Path, kind: str) -> Path:
    return Path(socket).with_suffix(kind)
