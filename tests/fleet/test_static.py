"""Static files in production have hashed names, also in imports between ES modules."""

import re

import pytest
from django.core.management import call_command


@pytest.fixture
def collected(settings, tmp_path):
    """A page's modules after `collectstatic` with production settings."""
    source = tmp_path / "source"
    source.mkdir()
    (source / "page.js").write_text(
        'import { stick } from "./stick.js";\nexport { zero } from "./stick.js";\nstick();\n'
    )
    (source / "stick.js").write_text("export const stick = () => {};\nexport const zero = 0;\n")
    for number in range(18):  # deeper than the imports of the page's modules
        (source / f"deep{number}.js").write_text(f'import {{ end }} from "./deep{number + 1}.js";\nend;\n')
    (source / "deep18.js").write_text("export const end = 0;\n")
    settings.STATICFILES_DIRS = [source]
    settings.STATICFILES_FINDERS = ["django.contrib.staticfiles.finders.FileSystemFinder"]
    settings.STATIC_ROOT = tmp_path / "collected"
    settings.STORAGES = settings.STORAGES | {"staticfiles": {"BACKEND": "fleet.static.HashedStaticFiles"}}
    call_command("collectstatic", interactive=False, verbosity=0)
    return settings.STATIC_ROOT


def test_modules_import_each_other_by_hashed_names(collected):
    (page,) = collected.glob("page.*.js")
    imported = re.findall(r'from "\./(stick\.[0-9a-f]{12}\.js)"', page.read_text())
    assert len(imported) == 2
    assert all((collected / name).is_file() for name in imported)
