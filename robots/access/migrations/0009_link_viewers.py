from datetime import timedelta

import django.db.models.deletion
from django.conf import settings
from django.db import migrations, models
from django.db.models import F


def when_seen(apps, schema_editor):
    """A link that was seen was valid for 30 days, to the end of the day: what came on the first day does not count."""
    seen = apps.get_model("access", "PasswordLink").objects.filter(seen=True)
    seen.update(seen_at=F("expires_at") - timedelta(days=30))


class Migration(migrations.Migration):

    dependencies = [
        ('access', '0008_lessons_count'),
        migrations.swappable_dependency(settings.AUTH_USER_MODEL),
    ]

    operations = [
        migrations.AddField(
            model_name='passwordlink',
            name='seen_at',
            field=models.DateTimeField(blank=True, null=True),
        ),
        migrations.AddField(
            model_name='passwordlink',
            name='seen_by',
            field=models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='+', to=settings.AUTH_USER_MODEL),
        ),
        migrations.RunPython(when_seen, migrations.RunPython.noop),
        migrations.RemoveField(
            model_name='passwordlink',
            name='seen',
        ),
    ]
