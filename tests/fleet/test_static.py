"""Static files in production: hashed names, and one file for all that a page's script or style sheet imports."""

import re

import pytest
from django.core.management import call_command


@pytest.fixture
def console(settings, tmp_path):
    """The source of a small console whose only page loads a script and a style sheet."""
    source = tmp_path / "source"
    for folder in ("js/lib", "css", "templates", "vendor"):
        (source / folder).mkdir(parents=True)
    (source / "templates/page.html").write_text(
        """<link rel="stylesheet" href="{% static 'css/page.css' %}">
        <link rel="stylesheet" href="{% static 'vendor/plot.css' %}">
        <script type="module" src="{% static 'js/page.js' %}"></script>"""
    )
    (source / "js/page.js").write_text('import { speed } from "./lib/stick.js";\ndocument.title = speed;\n')
    (source / "js/lib/stick.js").write_text('export const speed = "slow";\n')
    (source / "css/page.css").write_text(
        '@import "tokens.css";\n@import "../vendor/plot.css";\n.page { color: var(--ink); }\n'
    )
    (source / "vendor/plot.css").write_text(".plot { color: navy; }\n")
    (source / "css/tokens.css").write_text(":root { --ink: teal; }\n")
    settings.TEMPLATES = [{**settings.TEMPLATES[0], "DIRS": [source / "templates"]}]
    settings.STATICFILES_DIRS = [source]
    settings.STATICFILES_FINDERS = ["django.contrib.staticfiles.finders.FileSystemFinder"]
    settings.STATIC_ROOT = tmp_path / "collected"
    settings.STORAGES = settings.STORAGES | {
        "staticfiles": {"BACKEND": "fleet.site.static.HashedStaticFiles"}
    }
    return source


def collected(settings, pattern):
    """Collect the static files; return the files of this pattern, newest first."""
    call_command("collectstatic", interactive=False, verbosity=0)
    found = settings.STATIC_ROOT.glob(pattern)
    return [
        file.read_text() for file in sorted(found, key=lambda file: file.stat().st_mtime_ns, reverse=True)
    ]


def test_a_script_holds_all_that_it_imports_and_names_its_source_map(console, settings):
    (page,) = collected(settings, "js/page.????????????.js")
    assert "slow" in page
    assert "import" not in page
    (source_map,) = re.findall(r"sourceMappingURL=(page\.js\.[0-9a-f]{12}\.map)", page)
    assert "lib/stick.js" in (settings.STATIC_ROOT / "js" / source_map).read_text()


def test_a_style_sheet_holds_all_that_it_imports(console, settings):
    (page,) = collected(settings, "css/page.????????????.css")
    assert "teal" in page
    assert "@import" not in page


def test_a_file_that_a_page_loads_stays_though_another_imports_it(console, settings):
    (plot,) = collected(settings, "vendor/plot.????????????.css")
    assert "navy" in plot
    assert not list(settings.STATIC_ROOT.glob("css/tokens.????????????.css"))


def test_an_imported_file_that_changes_gives_the_script_a_new_name(console, settings):
    collected(settings, "js/page.????????????.js")
    (console / "js/lib/stick.js").write_text('export const speed = "fast";\n')
    new, old = collected(settings, "js/page.????????????.js")
    assert "fast" in new
    assert "slow" in old


def test_a_script_that_cannot_be_joined_ends_the_start(console, settings, capfd):
    (console / "js/lib/stick.js").unlink()
    with pytest.raises(Exception, match="esbuild"):
        collected(settings, "js/page.js")
    assert "stick.js" in capfd.readouterr().err
