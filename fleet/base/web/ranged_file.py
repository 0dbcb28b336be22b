"""A file as an answer that can be continued: one range of bytes, as RFC 9110 (14.2) has it."""

from __future__ import annotations

import os
import re
from typing import BinaryIO

from django.http import FileResponse, HttpRequest, HttpResponse, HttpResponseBase
from django.utils.http import quote_etag

_RANGE = re.compile(r"bytes=(\d*)-(\d*)")


class _Part:
    """The bytes of a file from its present place on, at most `left`."""

    def __init__(self, file: BinaryIO, left: int) -> None:
        self._file = file
        self._left = left

    def read(self, size: int = -1) -> bytes:
        data = self._file.read(self._left if size < 0 else min(size, self._left))
        self._left -= len(data)
        return data

    def close(self) -> None:
        self._file.close()


def ranged_file(
    request: HttpRequest, file: BinaryIO, version: str, name: str, content_type: str
) -> HttpResponseBase:
    """Return the file as a download with this name, or the part for which the request asks. The answer closes it.

    `version` differs if the bytes do.
    """
    size, tag = file.seek(0, os.SEEK_END), quote_etag(version)
    wanted = _wanted(request, size, tag)
    if wanted is not None and wanted[0] > wanted[1]:
        file.close()
        return HttpResponse(status=416, headers={"Content-Range": f"bytes */{size}"})
    begin, end = wanted or (0, size - 1)
    file.seek(begin)
    answer = FileResponse(
        _Part(file, end - begin + 1), as_attachment=True, filename=name, content_type=content_type
    )
    answer["Content-Length"] = str(end - begin + 1)
    answer["Accept-Ranges"], answer["ETag"] = "bytes", tag
    if wanted is not None:
        answer.status_code = 206
        answer["Content-Range"] = f"bytes {begin}-{end}/{size}"
    return answer


def _wanted(request: HttpRequest, size: int, tag: str) -> tuple[int, int] | None:
    """Return first and last byte of the range; None: the whole file. The first is greater if there is no such byte."""
    found = _RANGE.fullmatch(request.headers.get("Range", "").strip())
    if found is None or found[0] == "bytes=-" or request.headers.get("If-Range", tag) != tag:
        return None
    begin, end = found.groups()
    if not begin:
        return max(size - int(end), 0) if int(end) else size, size - 1
    if end and int(end) < int(begin):
        return None  # no valid range: it is ignored
    return int(begin), min(int(end or size - 1), size - 1)
