"""Bodies stay bytes until their operation decodes them."""

from __future__ import annotations

from typing import IO, Any

from rest_framework.parsers import BaseParser


class Unparsed(BaseParser):
    """Take a JSON body as bytes."""

    media_type = "application/json"

    def parse(self, stream: IO[Any], media_type: Any = None, parser_context: Any = None) -> Any:
        """Return the bytes."""
        return stream.read()
