"""Tag of templates: the last backup."""

from django.template import Library

from fleet.backup.selectors import LastBackup, last_backup

register = Library()


@register.inclusion_tag("backup/last.html", name="last_backup")
def shown() -> dict[str, LastBackup]:
    """Return what the template shows of the last backup."""
    return {"backup": last_backup()}
