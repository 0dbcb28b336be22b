"""The table of the cache that web processes share."""

from typing import Any

from django.core.management import call_command
from django.db import migrations


def make(_apps: Any, editor: Any) -> None:
    """Make the table of `CACHES`."""
    call_command("createcachetable", database=editor.connection.alias, verbosity=0)


class Migration(migrations.Migration):
    dependencies = [("accounts", "0005_token_made_with")]

    operations = [migrations.RunPython(make, migrations.RunPython.noop)]
