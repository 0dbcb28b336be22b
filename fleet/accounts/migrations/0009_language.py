from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("accounts", "0008_email_refused")]

    operations = [
        migrations.AddField(
            model_name="user",
            name="language",
            field=models.CharField(
                blank=True,
                help_text="Of pages and e-mails. Blank: the browser’s.",
                max_length=10,
                verbose_name="language",
            ),
        ),
    ]
