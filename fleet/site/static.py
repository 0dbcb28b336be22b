"""Static files for production."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, MutableMapping
from pathlib import Path
from typing import Any

from django.conf import settings
from django.core.exceptions import ImproperlyConfigured
from django.core.files.storage import FileSystemStorage
from whitenoise.storage import CompressedManifestStaticFilesStorage

# _LOADED finds all files that templates load; _JOINED finds the console's own modules and style sheets among
# them. If a page loads a module only when needed, the module is in an attribute data-…-module.
_LOADED = re.compile(r"{% static '([^']+)' %}")
_JOINED = re.compile(
    r"""(?:type="module" src|rel="stylesheet" href|data-[a-z]+-module)="{% static '((?:js|css)/[^']+)' %}">"""
)


class HashedStaticFiles(CompressedManifestStaticFilesStorage):  # type: ignore[misc]  # WhiteNoise is untyped
    """Static files with hashed names, compressed.

    Each script and style sheet is joined with its imports in one file.

    A browser requests a module only after it has read the module that imports it. One after the other, the
    modules of the control page took a second. In debug, and in tests of scripts, pages load the plain files.
    """

    def post_process(
        self, paths: MutableMapping[str, Any], dry_run: bool = False, **options: Any
    ) -> Iterator[Any]:
        """Join scripts and style sheets with their imports, then hash all files."""
        if dry_run:
            return
        with tempfile.TemporaryDirectory() as directory:
            sources, joined = Path(directory, "sources"), Path(directory, "joined")
            for name, (storage, path) in paths.items():
                source = sources / name
                source.parent.mkdir(parents=True, exist_ok=True)
                source.symlink_to(storage.path(path))
            templates = _templates()
            imported = _join(sources, joined, set(_JOINED.findall(templates)))
            for name in imported.difference(_LOADED.findall(templates)):
                del paths[name]
            for file in joined.rglob("*.*"):
                name = file.relative_to(joined).as_posix()
                paths[name] = FileSystemStorage(joined), name
                if file.suffix == ".map":  # WhiteNoise compresses each file under its plain name, too
                    shutil.copyfile(file, self.path(name))
            yield from super().post_process(paths, dry_run, **options)


def _templates() -> str:
    folders: Any = settings.TEMPLATES[0]["DIRS"]
    return "".join(file.read_text() for folder in folders for file in Path(folder).rglob("*.html"))


def _join(sources: Path, into: Path, entries: set[str]) -> set[str]:
    """Write each entry with its imports as one file, with a source map.

    Return the names of all files that were read.
    """
    # npm installs the program for this kind of computer
    programs = list(settings.BASE_DIR.glob("node_modules/@esbuild/*/bin/esbuild"))
    if not programs:
        raise ImproperlyConfigured("esbuild is not installed. Run: script/setup web")
    facts = sources / "facts"
    command: list[str | Path] = [
        *(programs[0], "--bundle", "--minify", "--format=esm", "--target=es2022", "--sourcemap"),
        *("--preserve-symlinks", f"--outdir={into}", "--outbase=.", f"--metafile={facts}"),
        *("--log-level=warning", *sorted(entries)),
    ]
    subprocess.run(command, cwd=sources, check=True)  # noqa: S603
    read: set[str] = set(json.loads(facts.read_text())["inputs"])
    return read
