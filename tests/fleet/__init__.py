"""The Django project: checks, URLs, texts, static files, probes, migrations, links of the docs."""
