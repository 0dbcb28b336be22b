"""Records in words."""

from django.utils import timezone

from fleet.audit.reading.wording import figure


def test_a_moment_is_shown_in_the_readers_zone():
    with timezone.override("Europe/Madrid"):
        assert figure("from", "2026-11-24T13:04:36.040626+00:00") == "from 24 Nov 2026, 14:04"
    assert figure("from", "2026-11-24") == "from 2026-11-24"
