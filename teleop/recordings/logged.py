"""Records of the log about a recording's time, within the parts that a person sees and the records they may read."""

from __future__ import annotations

from django.db.models import Q

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.audit.reading import wording
from fleet.audit.reading.listing import Row, rows_of
from robots.access.who_sees import Reader
from robots.shared.wire import TASK_KINDS
from teleop.recordings import times
from teleop.recordings.lines import Event
from teleop.recordings.selectors import Sight, of_courses, sessions_in

MOST = 500  # records of one recording
NEAR_S = 3.0  # a record this close to an event of the recording is the same one
# Kinds that an event of the recording has, too
_EVENT_OF = {"stop.press": "stop", "gate.begin": "gate", "fault": "fault"}
# They depend on nobody's control, and may name no control session
_OF_ROBOT = ("stop.press", "stop.clear", "stop.moves", "fault", "health.worse", "health.better")
# Drives are not among them: the replay has the stick
KINDS = (
    *(kind.record for kind in TASK_KINDS),
    *("speech.cancel", "motion.cancel", "go.hold", "service.call", "parameter.set", "parameter.delete"),
    *("control.take", "control.take_over", "control.hand_over", "control.end", "gate.begin", "refusal"),
    *_OF_ROBOT,
)


def logged(user: User, sight: Sight, reader: Reader) -> tuple[list[Event], bool]:
    """Return the records in order, without those that the recording itself has; and whether there are more."""
    within = Q()
    for part in sight.parts:
        within |= Q(at__range=(part.begins_at, part.ends_at))
    found = Record.objects.filter(
        within,
        _readable(user, sight, reader),
        Q(of=None) | Q(kind__in=("gate.begin", "refusal")),  # not the outcomes of requests
        robot_id=sight.recording.robot_id,
        kind__in=KINDS,
    )
    numbers = list(found.order_by("at").values_list("pk", flat=True)[: MOST + 1])
    known = [(event["event"], times.since_s(sight.recording, event["at"])) for event in sight.events]
    entries = []
    for row in rows_of(numbers[:MOST]):
        at_s = times.since(sight.recording, row.record.at)
        kind = _EVENT_OF.get(row.record.kind)
        if not any(event == kind and abs(at_s - event_s) < NEAR_S for event, event_s in known):
            entries.append(_entry(row, at_s))
    return entries, len(numbers) > MOST


def _readable(user: User, sight: Sight, reader: Reader) -> Q:
    """Return the condition that a person reads a record: `docs/audit.md` has the rule."""
    recording = sight.recording
    if reader.sees_past(recording.robot_id) or of_courses(reader, [recording]):
        return Q()
    own = [session.pk for session in sessions_in(recording) if session.user_id == user.pk]
    return Q(session_id__in=own) | Q(actor=str(user.pk)) | Q(session_id=None, kind__in=_OF_ROBOT)


def _entry(row: Row, at_s: float) -> Event:
    record = row.record
    what, outcome = wording.label(record.kind), wording.outcome(row.outcome)
    facts = wording.facts([record, row.end] if row.end else [record])
    words = [words for words in (wording.subject(record), outcome, *facts) if words not in ("", what)]
    if record.kind == "refusal":
        words = words[:1]  # its sentence says all
    group = record.kind.partition(".")[0]
    return Event(at_s, group, what, " · ".join(words), wording.who(record), is_logged=True)
