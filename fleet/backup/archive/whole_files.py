"""Files that are whole or not there."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PART = ".part"  # at the end of a name: the file is not whole yet


@contextmanager
def durable(target: Path) -> Iterator[Path]:
    """Give a temporary name in the folder of `target`. What is written there gets the name `target`, on the disk."""
    part = target.with_name(target.name + PART)
    part.unlink(missing_ok=True)
    try:
        yield part
        sync(part)
        part.replace(target)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    sync(target.parent)


def sync(path: Path) -> None:
    """Wait until the disk has the file, or the names in the folder, where its file system can tell."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError:
        if not path.is_dir():
            raise
    finally:
        os.close(descriptor)
