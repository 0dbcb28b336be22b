"""Verification finds and names every change to the log that the console did not make."""

import io
import json
import uuid
from datetime import UTC, date, datetime, timedelta
from unittest import mock

import pytest
from django.core.management import CommandError, call_command
from django.db import connection
from django.utils import timezone as django_timezone

from fleet.audit.integrity.verify import Head, compare, verify, verify_all
from fleet.audit.models import Chain, Content, Record
from fleet.audit.services import record
from tests.audit.support import index_anew, past_the_triggers, tamper

pytestmark = pytest.mark.django_db

ROBOT = uuid.UUID("7b0c1d9e-0000-4000-8000-000000000001")


@pytest.fixture
def chain(operator) -> list[Record]:
    """Records of one robot, mixed with records of another robot and of none."""
    return [_one(place, operator) for place in range(8)]


def _one(place: int, actor) -> Record:
    record("account.sign_in", actor=actor, private={"address": "10.0.0.7"})
    record("stop.press", actor=actor, robot_id=uuid.UUID(int=9), robot_name="TIAGo 9")
    return record(
        "speech.start",
        actor=actor,
        robot_id=ROBOT,
        robot_name="TIAGo 1",
        session_id=uuid.UUID(int=place),
        fence=place,
        parameters={"language": "en-GB", "rate": 1.5, "place": place},
        text=f"Sentence {place}.",
    )


def found() -> list[tuple[int | None, int | None, str]]:
    """Return the findings of verification: number, place in the chain, text."""
    report = verify_all()
    assert all(finding.chain == "TIAGo 1" for finding in report.findings)
    return [(finding.number, finding.seq, finding.what) for finding in report.findings]


def of(entry: Record, what: str) -> tuple[int, int, str]:
    return (entry.pk, entry.seq, what)


CHANGED = "is not what was written: it was changed or put in."


def test_an_untouched_log_has_no_findings(chain):
    report = verify_all()
    assert report.findings == []
    assert report.records == Record.objects.count()
    assert {head.name: head.seq for head in report.heads}["TIAGo 1"] == 8


@pytest.mark.parametrize(
    "change",
    [
        "kind = 'stop.press'",
        "at = '2020-01-01 00:00:00+00:00'",
        "day = '2020-01-01'",
        "actor_id = NULL",
        "robot_name = 'TIAGo 2'",
        "session_id = NULL",
        "fence = 99",
        "outcome = 'done'",
        'parameters = \'{"language": "en-GB", "rate": 1.6, "place": 3}\'',
        "parameters = '{}'",
        "of_id = 1",
    ],
)
def test_a_changed_record_is_named(chain, change):
    tamper(f"UPDATE audit_record SET {change} WHERE id = %s", chain[3].pk)
    assert found() == [of(chain[3], CHANGED)]


@pytest.mark.parametrize("digest", ["00" * 32, "zz", ""])
def test_a_changed_digest_and_its_successors_are_named(chain, digest):
    tamper("UPDATE audit_record SET digest = %s WHERE id = %s", digest, chain[3].pk)
    what = f"does not match record #{chain[3].pk} before it."
    assert found() == [of(chain[3], CHANGED), of(chain[4], what)]


RUBBISH = ["'garbage'", "'2020-13-45'", "-1", "1e999", "x'ff'", "CAST(x'ff' AS TEXT)"]


@pytest.mark.skipif(connection.vendor != "sqlite", reason="PostgreSQL keeps nothing but values of the column")
@pytest.mark.parametrize("rubbish", RUBBISH)
def test_any_change_of_a_cell_names_its_record(chain, rubbish):
    """SQLite stores any value in any column, also invalid ones."""
    columns = [field.column for field in Record._meta.fields if field.column != "id"]
    tamper("PRAGMA ignore_check_constraints = ON")
    tamper("CREATE TEMP TABLE kept AS SELECT * FROM audit_record WHERE id = %s", chain[3].pk)
    for column in columns:
        tamper(f"UPDATE audit_record SET {column} = {rubbish} WHERE id = %s", chain[3].pk)
        numbers = {finding.number for finding in verify_all().findings}
        assert chain[3].pk in numbers, column
        assert numbers <= {chain[3].pk, chain[4].pk}, column  # the next record may no longer match
        tamper(f"UPDATE audit_record SET {column} = (SELECT {column} FROM kept) WHERE id = %s", chain[3].pk)
    tamper("PRAGMA ignore_check_constraints = OFF")
    assert verify_all().findings == []


@pytest.mark.skipif(connection.vendor != "sqlite", reason="PostgreSQL keeps nothing but values of the column")
@pytest.mark.parametrize("rubbish", [word for word in RUBBISH if word != "'2020-13-45'"])
def test_a_changed_chain_identifier_is_found(chain, rubbish):
    tamper(f"UPDATE audit_chain SET id = {rubbish} WHERE name = 'TIAGo 1'")
    findings = verify_all().findings
    assert "database: a chain cannot be read: it was changed." in map(str, findings)
    assert {entry.pk for entry in chain} <= {finding.number for finding in findings}


def test_a_removed_record_is_named_by_its_place(chain):
    tamper("DELETE FROM audit_content WHERE record_id = %s", chain[3].pk)
    tamper("DELETE FROM audit_record WHERE id = %s", chain[3].pk)
    assert found() == [of(chain[4], "comes too early: record 4 of this chain is missing.")]


def test_the_beginning_cannot_be_removed_without_a_checkpoint(chain):
    first, second = chain[0].pk, chain[1].pk
    tamper("DELETE FROM audit_content WHERE record_id IN (%s, %s)", first, second)
    tamper("DELETE FROM audit_record WHERE id IN (%s, %s)", first, second)
    assert found() == [of(chain[2], "comes too early: records 1 to 2 of this chain are missing.")]


def test_all_records_of_a_robot_cannot_be_removed(chain):
    with past_the_triggers(), connection.cursor() as cursor:
        numbers = [entry.pk for entry in chain]
        for table, key in (("audit_content", "record_id"), ("audit_record", "id")):
            cursor.execute(f"DELETE FROM {table} WHERE {key} BETWEEN %s AND %s", [numbers[0], numbers[-1]])
    assert (None, None, "all of its records are missing.") in [
        (finding.number, finding.seq, finding.what)
        for finding in verify(Chain.objects.filter(pk=ROBOT)).findings
    ]


def test_a_record_put_in_at_the_end_is_named(chain):
    columns = ", ".join(
        field.column for field in Record._meta.fields if field.column not in ("id", "seq", "content_digest")
    )
    tamper(
        f"INSERT INTO audit_record (id, seq, content_digest, {columns})"
        f" SELECT id + 100, seq + 1, '', {columns} FROM audit_record WHERE id = %s",
        chain[-1].pk,
    )
    assert found() == [(chain[-1].pk + 100, 9, CHANGED)]


def test_a_record_put_in_for_a_robot_without_chain_is_named(chain):
    columns = ", ".join(
        field.column for field in Record._meta.fields if field.column not in ("id", "robot_id")
    )
    stray = uuid.UUID(int=77)
    tamper(
        f"INSERT INTO audit_record (id, robot_id, {columns}) SELECT id + 100, %s, {columns}"
        " FROM audit_record WHERE id = %s",
        stray.hex if connection.vendor == "sqlite" else stray,
        chain[0].pk,
    )
    [finding] = verify_all().findings
    assert (finding.chain, finding.number) == (str(stray), chain[0].pk + 100)
    assert finding.what == "belongs to no chain: it was put in."


def test_records_whose_places_were_swapped_are_named(chain):
    for place, entry in ((1000, chain[2]), (3, chain[5]), (6, chain[2])):
        tamper("UPDATE audit_record SET seq = %s WHERE id = %s", place, entry.pk)
    findings = {number: what for number, _seq, what in found()}
    assert findings[chain[5].pk] == CHANGED
    assert findings[chain[3].pk] == f"is out of order after #{chain[5].pk}: records were swapped."
    assert findings[chain[2].pk] == f"is out of order after #{chain[4].pk}: records were swapped."
    assert chain[0].pk not in findings and chain[7].pk not in findings


def test_records_whose_words_were_swapped_are_both_named(chain):
    for taken, given in ((chain[2], chain[5]), (chain[5], chain[2])):
        tamper("UPDATE audit_record SET fence = %s WHERE id = %s", given.fence, taken.pk)
    assert found() == [of(chain[2], CHANGED), of(chain[5], CHANGED)]


@pytest.mark.parametrize(
    "change",
    ["text = 'Something else.'", "data = '{\"mood\": 1}'", "salt = 'zz'", "salt = ''", "salt = '00'"],
)
def test_spoken_texts_cannot_be_changed(chain, change):
    tamper(f"UPDATE audit_content SET {change} WHERE record_id = %s", chain[3].pk)
    index_anew()
    assert found() == [of(chain[3], "has another content than was written.")]


def test_spoken_texts_cannot_be_removed_early(chain):
    chain[3].content.delete()
    assert found() == [of(chain[3], "has lost its content too early.")]


@pytest.mark.parametrize(
    "parameters",
    [
        {"kinds": {"speech.start": {"before": "9999-01-01", "removed": 8}}},
        {"kinds": {"speech.start": {"before": "TODAY", "removed": 8}}},
        {"kinds": {"speech.start": {"before": "garbage"}}},
        {"kinds": {"speech.start": {}}},
        {"kinds": []},
        {},
    ],
)
def test_contents_never_expire_before_their_time(chain, parameters):
    today = str(django_timezone.now().date() + timedelta(days=1))
    expiry = record("audit.expire", parameters=json.loads(json.dumps(parameters).replace("TODAY", today)))
    chain[3].content.delete()
    findings = {finding.number: finding.what for finding in verify_all().findings}
    assert findings == {
        expiry.pk: "reports contents that expired too early, or is not valid.",
        chain[3].pk: "has lost its content too early.",
    }


def test_a_record_dated_in_the_future_justifies_no_removal(chain):
    with mock.patch.object(django_timezone, "now", return_value=datetime(2100, 1, 1, tzinfo=UTC)):
        erasure = record(
            "audit.expire", parameters={"kinds": {"speech.start": {"before": "2099-01-01", "removed": 8}}}
        )
    chain[3].content.delete()
    assert {finding.number for finding in verify_all().findings} == {erasure.pk, chain[3].pk}


@pytest.mark.parametrize("records", ["all", None, {}])
def test_an_erasure_explains_only_earlier_named_records(chain, records):
    record("audit.erase", parameters={} if records is None else {"records": records})
    to_come = range(chain[7].pk + 1, chain[7].pk + 100)
    erasure = record("audit.erase", parameters={"records": [chain[2].pk, *to_come]})
    later = _one(8, None)
    assert erasure.pk < later.pk in to_come
    for entry in (chain[2], chain[3], later):
        entry.content.delete()
    what = "has lost its content too early."
    assert found() == [of(chain[3], what), of(later, what)]


# --- checkpoints --------------------------------------------------------------------------------------

FORGED = "is no checkpoint of the console and is ignored."


def forge(chain, **changes) -> Record:
    """Append a checkpoint that covers the whole chain, then delete the chain. The triggers allow this."""
    last = chain[-1]
    removed = {"through": last.seq, "digest": last.digest, "removed": last.seq, "before": "2020-01-01"}
    forged = record("audit.checkpoint", robot_id=ROBOT, robot_name="TIAGo 1", parameters=removed | changes)
    gone = Record.objects.filter(robot_id=ROBOT, seq__lte=last.seq)
    Content.objects.filter(record__in=gone).delete()
    gone._raw_delete(gone.db)
    return forged


@pytest.mark.parametrize(
    "changes",
    [
        {"before": "9999-01-01"},
        {"before": str(django_timezone.now().date())},
        {"before": None},
        {"before": "garbage"},
        {"digest": "zz"},
        {"digest": None},
        {"removed": 0},
        {"removed": 9},
        {"removed": "all"},
    ],
)
def test_a_foreign_checkpoint_explains_nothing(chain, changes):
    forged = forge(chain, **changes)
    assert found() == [
        of(forged, "comes too early: records 1 to 8 of this chain are missing."),
        of(forged, FORGED),
    ]
    with pytest.raises(SystemExit):
        call_command("verify_audit", stderr=io.StringIO())


def test_a_checkpoint_continues_where_the_previous_ended(chain):
    lawful = {"through": 4, "digest": chain[3].digest, "removed": 4, "before": "2020-01-01"}
    record("audit.checkpoint", robot_id=ROBOT, parameters=lawful)
    forged = record("audit.checkpoint", robot_id=ROBOT, parameters=lawful | {"through": 6, "removed": 6})
    assert found() == [of(forged, FORGED)]


def test_early_removed_records_show_against_kept_heads(chain):
    """The database alone cannot show that the records were not from before 2020."""
    heads = verify_all().heads
    forge(chain)
    assert verify_all().findings == []
    [finding] = compare(heads)
    assert (finding.chain, finding.number, finding.seq) == ("TIAGo 1", None, 8)
    assert finding.what.startswith("was removed too early: it was of 20")


def test_a_checkpoint_far_beyond_the_end_shows_against_heads(chain):
    heads = verify_all().heads
    billion = 10**9
    forged = record(
        "audit.checkpoint",
        robot_id=ROBOT,
        parameters={
            "through": billion - 1,
            "digest": "0" * 64,
            "removed": billion - 1,
            "before": "2020-01-01",
        },
    )
    tamper("UPDATE audit_record SET seq = %s WHERE id = %s", billion, forged.pk)
    tamper("DELETE FROM audit_content WHERE record_id IN (SELECT id FROM audit_record WHERE seq < 9)")
    tamper("DELETE FROM audit_record WHERE robot_id IS NOT NULL AND seq < 9 AND kind = 'speech.start'")
    [finding] = [finding for finding in compare(heads) if finding.chain == "TIAGo 1"]
    assert finding.what.startswith("was removed too early: it was of 20")


def test_old_records_that_were_removed_fit_heads_of_their_time(chain):
    heads = [
        Head(head.chain, head.name, head.seq, head.digest, datetime(2019, 12, 31, tzinfo=UTC))
        for head in verify_all().heads
    ]
    forge(chain)
    assert list(compare(heads)) == []
    [mine] = [head for head in heads if head.name == "TIAGo 1"]
    [finding] = compare([Head(mine.chain, mine.name, mine.seq, "00" * 32, mine.at)])
    assert finding.what == "differs in the checkpoint from the kept head."


# --- heads ----------------------------------------------------------------------------------------


def test_a_cut_tail_shows_against_heads_kept_elsewhere(chain):
    heads = verify_all().heads
    tamper("DELETE FROM audit_content WHERE record_id = %s", chain[-1].pk)
    tamper("DELETE FROM audit_record WHERE id = %s", chain[-1].pk)
    assert verify_all().findings == []  # the rest has no findings
    [finding] = compare(heads)
    assert finding.chain == "TIAGo 1" and finding.what.startswith("its end is cut off: it had 8 records")


def test_a_recomputed_chain_differs_from_kept_heads(chain, operator):
    heads = verify_all().heads
    tamper("DELETE FROM audit_content WHERE record_id = %s", chain[-1].pk)
    tamper("DELETE FROM audit_record WHERE id = %s", chain[-1].pk)
    _one(7, operator)
    assert verify_all().findings == []
    [finding] = compare(heads)
    assert (finding.seq, finding.what) == (8, "differs from the kept head.")


def test_a_chain_that_has_grown_fits_older_heads(chain, operator):
    heads = verify_all().heads
    _one(8, operator)
    assert list(compare(heads)) == []


# --- the command ----------------------------------------------------------------------------------


def test_the_command_writes_and_compares_heads(chain, tmp_path):
    kept, words = tmp_path / "heads.jsonl", io.StringIO()
    call_command("verify_audit", heads=str(kept), stdout=words)
    assert "All are as written." in words.getvalue()
    heads = [json.loads(line) for line in kept.read_text().splitlines()]
    assert {"TIAGo 1": 8, "TIAGo 9": 8}.items() <= {head["name"]: head["seq"] for head in heads}.items()
    call_command("verify_audit", against=str(kept), stdout=io.StringIO())
    verification = Record.objects.filter(kind="audit.verify").latest("id")
    assert (verification.outcome, verification.parameters["findings"], verification.actor_id[:7]) == (
        "intact",
        0,
        "system:",
    )


def test_findings_give_exit_status_1_and_words(chain):
    tamper("UPDATE audit_record SET fence = 99 WHERE id = %s", chain[3].pk)
    words = io.StringIO()
    with pytest.raises(SystemExit) as ended:
        call_command("verify_audit", robot="TIAGo 1", stderr=words)
    assert ended.value.code == 1
    assert f"TIAGo 1: record #{chain[3].pk} (place 4) {CHANGED}" in words.getvalue()
    assert Record.objects.get(kind="audit.verify").outcome == "findings"


def test_only_the_named_robot_is_verified(chain):
    tamper("UPDATE audit_record SET fence = 99 WHERE id = %s", chain[3].pk)
    words = io.StringIO()
    call_command("verify_audit", robot=str(uuid.UUID(int=9)), stdout=words)
    without_robot = Record.objects.filter(robot_id=None).exclude(kind="audit.verify").count()
    assert f"Chains: 2, records: {8 + without_robot}. All are as written." in words.getvalue()


def test_a_deleted_robots_expiry_knowledge_goes_too(chain):
    """Verification of one robot also finds a changed old record of an erasure."""
    erasure = record("audit.erase", parameters={"person": "x", "records": [1]})
    later = record("audit.erase", parameters={"person": "x", "records": []})
    tamper(
        "UPDATE audit_record SET parameters = %s WHERE id = %s",
        json.dumps({"person": "x", "records": [chain[3].pk]}),
        erasure.pk,
    )
    chain[3].content.delete()
    words = io.StringIO()
    with pytest.raises(SystemExit):
        call_command("verify_audit", robot="TIAGo 1", stderr=words)
    assert f"record #{erasure.pk}" in words.getvalue() and f"#{later.pk}" not in words.getvalue()


def test_heads_on_standard_output_are_nothing_but_heads(chain, capsys):
    call_command("verify_audit", heads="-", stderr=io.StringIO())
    assert all(json.loads(line)["digest"] for line in capsys.readouterr().out.splitlines())


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"robot": "nobody"}, "0 robots with records are called nobody"),
        ({"against": "/no/such/file"}, "cannot be read as heads"),
    ],
)
def test_invalid_options_are_refused_in_words(options, words):
    with pytest.raises(CommandError, match=words):
        call_command("verify_audit", **options)


def test_days_are_those_of_utc(chain):
    assert isinstance(chain[0].day, date)
    assert all(entry.day == entry.at.date() for entry in Record.objects.all())
