"""Settings of `script/demo`: the console's, and the demo's door."""

from pathlib import Path

from fleet import settings as console
from fleet.settings import *  # noqa: F403

ROOT_URLCONF = "script.stack.door.urls"
_templates = console.TEMPLATES[0]
TEMPLATES = [{**_templates, "DIRS": [Path(__file__).parent / "templates", console.BASE_DIR / "templates"]}]
