"""Exports of the audit log as files."""

import csv
import io
import itertools
import json
from datetime import timedelta
from types import SimpleNamespace

import pytest
from django.core.signals import request_started
from django.test import AsyncClient
from django.urls import reverse
from django.utils import timezone

from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from fleet.audit.reading import exports
from fleet.audit.reading.exports import BOM, COLUMNS, Format
from fleet.audit.reading.listing import Selection, Wanted
from fleet.audit.services import record
from teleop.models import ControlSession, EndReason

pytestmark = pytest.mark.django_db(transaction=True)

SPEECH = "admin:audit_speechrecord_export"
SESSIONS = "admin:teleop_controlsession_export"


@pytest.fixture
def export(staff):
    """`await export("csv", "q=hello")`: return the file's text and the response."""

    async def fetch(format_, query="", name=SPEECH):
        client = AsyncClient()
        await client.aforce_login(staff)
        response = await client.post(f"{reverse(name)}?{query}", {"format": format_})
        assert response.status_code == 200
        content = b"".join([piece async for piece in response.streaming_content])
        return content.decode(), response

    return fetch


def say(text, outcome="succeeded", **more):
    start = record("speech.start", robot_name="TIAGo 1", text=text, **more)
    record("speech.end", of=start, outcome=outcome)
    return start


async def test_csv_has_a_row_for_each_request_with_its_outcome(export, operator):
    await exports.sync_to_async(say)('Hello, "world"\n你好', actor=operator)
    text, response = await export("csv")
    assert text.startswith(BOM)
    [row] = csv.DictReader(io.StringIO(text.removeprefix(BOM), newline=""))
    assert list(row) == COLUMNS
    assert (row["subject"], row["person"], row["outcome"]) == (
        'Hello, "world"\n你好',
        "Olga Operator",
        "succeeded",
    )
    assert response["Content-Type"].startswith("text/csv")
    assert "attachment" in response["Content-Disposition"]
    assert "no-store" in response["Cache-Control"]


async def test_exports_keep_the_viewings_that_lists_leave_out(export, operator):
    viewing = await exports.sync_to_async(record)("camera.start", actor=operator)
    text, _response = await export("jsonl", name="admin:audit_record_export")
    assert viewing.pk in [json.loads(line)["number"] for line in text.splitlines()]


async def test_json_lines_have_all_columns_and_the_outcome_inside(export, operator):
    start = await exports.sync_to_async(say)("Hello\nworld", actor=operator, fence=7)
    text, _response = await export("jsonl")
    [entry] = [json.loads(line) for line in text.splitlines()]
    assert (entry["number"], entry["details"]["text"], entry["fence"]) == (start.pk, "Hello\nworld", 7)
    assert entry["person"] == {"id": str(operator.pk), "name": "Olga Operator"}
    assert entry["digest"] == start.digest
    assert (entry["ended"]["outcome"], entry["ended"]["of"]) == ("succeeded", start.pk)


async def test_only_filtered_records_are_exported(export):
    for outcome in ("succeeded", "failed"):
        await exports.sync_to_async(say)(f"it {outcome}", outcome)
    text, _response = await export("jsonl", "outcome=failed&q=it")
    assert [json.loads(line)["details"]["text"] for line in text.splitlines()] == ["it failed"]


async def test_a_long_export_is_complete_and_in_order(export, monkeypatch):
    monkeypatch.setattr(exports, "CHUNK", 2)
    starts = [await exports.sync_to_async(say)(f"text {number}") for number in range(5)]
    text, _response = await export("jsonl")
    assert [json.loads(line)["number"] for line in text.splitlines()] == [start.pk for start in starts][::-1]


async def test_an_export_is_recorded_with_filters_and_row_count(export, staff):
    await exports.sync_to_async(say)("secret words")
    await export("csv", "q=secret+words&outcome=succeeded&since=2026-01-01")
    begun, ended = [entry async for entry in Record.objects.filter(kind="audit.export").order_by("pk")]
    assert begun.actor_id == str(staff.pk)
    assert begun.parameters == {
        "list": "speech",
        "format": "csv",
        "outcome": "succeeded",
        "since": "2026-01-01",
    }
    assert (await exports.sync_to_async(lambda: begun.details)())["words"] == "secret words"
    assert (ended.of_id, ended.outcome, ended.parameters) == (begun.pk, "done", {"rows": 1})


async def test_an_unread_export_is_recorded_as_broken_off(staff, monkeypatch):
    monkeypatch.setattr(exports, "CHUNK", 2)
    for number in range(5):
        await exports.sync_to_async(say)(f"text {number}")
    selection = Selection(Wanted(), ["speech.start"])
    response = await exports.sync_to_async(exports.response)(
        exports.records(selection, Format.CSV), Wanted(), actor=staff, name="speech"
    )
    pieces = aiter(response.streaming_content)
    await anext(pieces)  # the header line
    await anext(pieces)
    await exports.sync_to_async(response.close)()
    await exports.sync_to_async(response.close)()
    ended = await Record.objects.aget(kind="audit.export", of__isnull=False)
    assert (ended.outcome, ended.parameters) == ("broken_off", {"rows": 2})


async def test_an_export_makes_way_for_other_requests(staff, monkeypatch):
    monkeypatch.setattr(exports, "CHUNK", 1)
    for number in range(2):
        await exports.sync_to_async(say)(f"text {number}")
    now = itertools.count(step=0.125)  # seconds for each piece
    pauses_s = []

    async def pause(seconds):
        pauses_s.append(seconds)

    monkeypatch.setattr(exports, "time", SimpleNamespace(perf_counter=lambda: next(now)))
    monkeypatch.setattr(exports, "asyncio", SimpleNamespace(sleep=pause))
    content = exports.records(Selection(Wanted(), ["speech.start"]), Format.CSV)
    response = await exports.sync_to_async(exports.response)(content, Wanted(), actor=staff, name="speech")
    pieces = aiter(response.streaming_content)
    await anext(pieces)  # the header line
    await anext(pieces)
    request_started.send(sender=None)
    async for _piece in pieces:
        pass
    assert pauses_s == [0.125 * exports.PAUSE_BESIDE_OTHERS, 0.125 * exports.PAUSE]


def test_an_unrecorded_export_is_not_sent(staff, signed_in, monkeypatch):
    def fails(*_args, **_named):
        raise AuditUnavailable("audit_locked", "Not done, because it could not be recorded.")

    monkeypatch.setattr(exports, "record", fails)
    response = signed_in(staff).post(reverse(SPEECH), {"format": "csv"})
    assert response.status_code == 503


@pytest.mark.parametrize(("method", "status"), [("get", 405), ("head", 405)])
def test_a_link_alone_exports_nothing(method, status, staff, signed_in):
    assert getattr(signed_in(staff), method)(reverse(SPEECH)).status_code == status


@pytest.mark.parametrize(
    ("query", "form"), [("", {"format": "xlsx"}), ("", {}), ("since=x", {"format": "csv"})]
)
def test_an_invalid_filter_exports_nothing(query, form, staff, signed_in):
    assert signed_in(staff).post(f"{reverse(SPEECH)}?{query}", form).status_code == 400
    assert not Record.objects.filter(kind="audit.export").exists()


# --- cells ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["=cmd|' /C calc'!A0", '","=1+1', "\n=1+1", '";=1+1'])
async def test_no_text_makes_a_cell_a_formula(text, export):
    await exports.sync_to_async(say)(text)
    content, _response = await export("csv")
    for delimiter in (",", ";", "\t"):
        rows = list(csv.reader(io.StringIO(content.removeprefix(BOM), newline=""), delimiter=delimiter))
        if delimiter == ",":
            assert len(rows) == 2
            assert not any(cell.startswith(("=", "+", "-", "@", "\t", "\r")) for cell in rows[1])


@pytest.fixture
def sessions(robot, other_robot, operator, staff):
    """Two control sessions; the newer one has not ended."""
    now = timezone.now()
    for fence, (of, person, reason) in enumerate(
        ((robot, operator, EndReason.TAKEN_OVER), (other_robot, staff, "")), 1
    ):
        ControlSession.objects.create(
            robot=of,
            user=person,
            fence=fence,
            started_at=now + timedelta(minutes=fence),
            ended_at=now + timedelta(minutes=fence + 1) if reason else None,
            end_reason=reason,
        )


@pytest.mark.parametrize("format_", ["csv", "jsonl"])
async def test_control_sessions_are_exported_like_records(
    format_, export, sessions, other_robot, monkeypatch
):
    monkeypatch.setattr(exports, "CHUNK", 1)
    text, _response = await export(format_, name=SESSIONS)
    lines = text.removeprefix(BOM).splitlines()
    rows = [*map(json.loads, lines)] if format_ == "jsonl" else [*csv.DictReader(lines)]
    assert [row["person"] for row in rows] == ["Sam Staff", "Olga Operator"]
    assert [row["ended_by"] for row in rows] == ["", "taken_over"]
    assert not rows[0]["ended_utc"] and rows[1]["ended_utc"]
    begun, done = [entry async for entry in Record.objects.filter(kind="audit.export").order_by("pk")]
    assert begun.parameters == {"list": "control-sessions", "format": format_}
    assert (done.outcome, done.parameters) == ("done", {"rows": 2})
    text, _response = await export(format_, f"robot={other_robot.pk}", name=SESSIONS)
    assert "Sam" in text and "Olga" not in text


async def test_sessions_of_the_same_moment_are_all_listed(export, sessions, monkeypatch):
    monkeypatch.setattr(exports, "CHUNK", 1)
    await ControlSession.objects.aupdate(started_at=timezone.now())
    text, _response = await export("jsonl", name=SESSIONS)
    people = {json.loads(line)["person"] for line in text.splitlines()}
    assert people == {"Sam Staff", "Olga Operator"}
