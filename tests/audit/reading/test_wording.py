"""Records in words."""

from django.utils import timezone

from fleet.audit.reading.wording import figure, lines, outcome


def test_a_moment_is_shown_in_the_readers_zone():
    with timezone.override("Europe/Madrid"):
        assert figure("from", "2026-11-24T13:04:36.040626+00:00") == "from 24 Nov 2026, 14:04"
        assert dict(lines({"of": {"from": "2026-11-24T13:04:36+00:00"}})) == {
            "of · from": "24 Nov 2026, 14:04"
        }
    assert figure("from", "2026-11-24") == "from 2026-11-24"


def test_an_outcome_that_only_programmers_know_has_words():
    assert outcome("intruder") == "cancelled, but not by its holder"
    assert outcome("control_ended") == "control ended"


def test_a_field_that_changed_is_said_in_words():
    assert figure("field", "is_staff") == "field is staff"
