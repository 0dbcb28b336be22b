"""Recordings: list, contents, replay, file; keeping, sharing and deleting. Each person sees their part only."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Annotated, Any, Literal
from uuid import UUID

from django.http import HttpResponse, HttpResponseBase
from django.shortcuts import get_object_or_404
from msgspec import Meta, Struct

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from fleet.base.web.ranged_file import ranged_file
from robots.access.models import Course
from robots.access.who_sees import reader_of
from robots.recordings import stores
from robots.recordings.away import FileAway
from robots.recordings.files.contents import Contents, Unreadable
from robots.recordings.models import Recording
from robots.registry.models import Robot
from robots.shared.wire import Refusal
from teleop.api.v1.framework.cursors import page_by_time
from teleop.api.v1.framework.operation import ApiView, entry_of, reads
from teleop.api.v1.framework.parameters import Cursor, Limit, Moment, Order, Time, utc
from teleop.api.v1.framework.problems import NOT_FOUND, Problem
from teleop.api.v1.setup.base import makes, manages
from teleop.models import RecordingShare
from teleop.recordings import downloads, pictures, replay, services
from teleop.recordings.listing import Filters, filtered, seen
from teleop.recordings.selectors import Sight, sight_of

Seconds = Annotated[float, Meta(ge=0.0, le=90_000.0, description="Since the recording began.")]
Topic = Annotated[str, Meta(min_length=1, max_length=255)]
Words = Annotated[str, Meta(max_length=150)]


class RecordingEntry(Struct, frozen=True):
    """A recording, as far as you see it. `yours`: you asked for it, or had control.

    Who sees only the time of their own sessions in the recording of another person is not told whose it is.
    """

    id: UUID
    robot: str
    person: str | None  # name; null: nobody, or you are not told
    yours: bool
    kind: Literal["black_box", "by_hand", "booking"]
    begins_at: Time
    ends_at: Time
    session: UUID | None
    booking: UUID | None
    course: str
    reason: str
    bytes: int
    dropped: int  # messages that are missing in it
    cut: bool  # its last second may be missing: the recorder broke
    events: list[dict[str, Any]]  # in the parts that you see
    topics: list[dict[str, Any]]
    kept: bool  # retention leaves it alone
    thumbnail: bool


class RecordingList(Struct, frozen=True):
    """Recordings, newest first unless `order` says otherwise. `next` is the cursor of the next page."""

    recordings: list[RecordingEntry]
    next: str | None


class RecordingsAsked(Struct, frozen=True, forbid_unknown_fields=True, rename={"from_": "from"}):
    """Filters of recordings."""

    robot: Words = ""
    person: Annotated[str, Meta(max_length=150, description="A user name, or part of a name.")] = ""
    course: Words = ""
    kind: Literal["", "black_box", "by_hand", "booking"] = ""
    event: Literal["", "stop", "gate", "fault", "contact", "keep"] = ""
    topic: Annotated[str, Meta(max_length=255)] = ""
    from_: Moment | None = None
    to: Moment | None = None
    q: Words = ""
    order: Order = "newest"
    cursor: Cursor | None = None
    limit: Limit = 50


class ShareEntry(Struct, frozen=True):
    """A person, or a course, who sees the whole recording. `number`: to end it."""

    number: int
    person: str | None  # user name
    course: str | None


class RecordingDetail(Struct, frozen=True):
    """A recording with its contents, as far as you see it: `contents.parts`."""

    recording: RecordingEntry
    whole: bool
    may_change: bool
    contents: replay.RecordedContents
    shares: list[ShareEntry]  # only for those who may change it


class ViewsAsked(Struct, frozen=True, forbid_unknown_fields=True, rename={"from_": "from"}):
    """A time."""

    from_: Seconds
    to: Seconds


class PictureAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """A topic with pictures, and a moment."""

    topic: Topic
    at: Seconds


class SeriesAsked(Struct, frozen=True, forbid_unknown_fields=True, rename={"from_": "from"}):
    """A field of a topic, and a time."""

    topic: Topic
    field: Annotated[str, Meta(min_length=1, max_length=200, description="Such as `twist.linear.x`.")]
    from_: Seconds
    to: Seconds


class FileAsked(Struct, frozen=True, forbid_unknown_fields=True, rename={"from_": "from"}):
    """The part that is downloaded."""

    format: downloads.FileFormat = "mcap"
    from_: Seconds | None = None
    to: Seconds | None = None
    topics: Annotated[str, Meta(max_length=5000, description="Separated by commas. None: all.")] = ""
    pictures: bool = True


class KeepRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """Whether it is kept until somebody deletes it."""

    kept: bool


class ShareRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A person (user name), or a course."""

    person: Words | None = None
    course: Words | None = None


_NO_SUCH_NAME = Refusal("not_found", "No person and no course has this name.", "wire")
_ONE_OF_BOTH = Refusal("invalid", "Name a person or a course, not both.", "wire")


class RecordingBase(ApiView):
    tag = "recordings"

    def concerned(self, *_path: Any, **asked: Any) -> Iterable[Robot]:
        return [self.sight(asked["recording_id"]).recording.robot] if "recording_id" in asked else ()

    def sight(self, recording_id: UUID) -> Sight:
        """Return what the person, or the token, sees. Raises `Problem`."""
        recording = Recording.objects.filter(pk=recording_id).select_related("robot", "person").first()
        sight = sight_of(self.person, recording) if recording else None
        if sight is None or (self.token is not None and not self.token.serves(sight.recording.robot_id)):
            raise Problem(NOT_FOUND)
        return sight

    @contextmanager
    def contents(self, sight: Sight) -> Iterator[Contents]:
        """Open the file. Raises `Problem` or `FileAway`."""
        try:
            with stores.open_file(sight.recording) as stream:
                yield Contents(stream, sight.recording.pk)
        except OSError as error:
            raise FileAway from error
        except Unreadable as error:
            raise Problem(downloads.UNREADABLE) from error

    def entry(self, sight: Sight) -> RecordingEntry:
        """Return a recording as it is shown to this person."""
        recording, told = sight.recording, sight.tells_owner
        return entry_of(
            RecordingEntry,
            recording,
            robot=recording.robot.slug,
            person=recording.person.display_name if told and recording.person else None,
            yours=recording.person_id == self.person.pk,
            session=recording.session if told else None,
            reason=recording.reason if told else "",
            events=sight.events,
            kept=recording.kept_at is not None,
        )


class RecordingsView(RecordingBase):
    @reads("recordings_list", "List recordings")
    def get(self, query: RecordingsAsked) -> RecordingList:
        """Those of which you see at least a part. A page with a filter may have fewer than `limit`."""
        filters = Filters(
            query.robot,
            query.person,
            query.course,
            query.kind,
            query.event,
            query.topic,
            utc(query.from_) if query.from_ else None,
            utc(query.to) if query.to else None,
            query.q,
        )
        reader = reader_of(self.person)
        found = filtered(self.person, reader, filters).select_related("robot", "person")
        if self.token is not None and self.token.robots:
            found = found.filter(robot__in=self.token.robots)
        rows, following = page_by_time(
            found, "begins_at", query.cursor, query.limit, oldest_first=query.order == "oldest"
        )
        shown = seen(self.person, rows, reader, query.event)
        return RecordingList([self.entry(sight) for sight in shown], following)


class RecordingView(RecordingBase):
    @reads("recordings_read", "Read what is in a recording")
    def get(self, recording_id: UUID) -> RecordingDetail:
        """Times are in seconds since it began."""
        sight = self.sight(recording_id)
        shares = sight.recording.shares.select_related("person", "course") if sight.may_change else []
        with self.contents(sight) as contents:
            return RecordingDetail(
                self.entry(sight),
                sight.whole,
                sight.may_change,
                replay.contents_of(sight, contents),
                [_share(share) for share in shares],
            )

    @manages("recordings_delete", "Delete a recording")
    def delete(self, recording_id: UUID) -> None:
        """For its owner, supervisors of the robot or course, and staff. On record; nobody can undo it."""
        services.recording_delete(recording=self.sight(recording_id).recording, actor=self.person)


class KeepView(RecordingBase):
    @manages("recordings_keep", "Keep a recording")
    def put(self, recording_id: UUID, body: KeepRequest) -> None:
        """One that is kept stays until somebody deletes it. For those who may change it."""
        recording = self.sight(recording_id).recording
        services.recording_keep(recording=recording, keep=body.kept, actor=self.person)


class SharesView(RecordingBase):
    @makes("recordings_share", "Share a recording", refuses=(404, 409))
    def post(self, recording_id: UUID, body: ShareRequest) -> ShareEntry:
        """Show all of it to a person or to the people of a course. For those who may change it."""
        if (body.person is None) == (body.course is None):
            raise Problem(_ONE_OF_BOTH)
        recording = self.sight(recording_id).recording
        person = User.objects.filter(username=body.person, is_active=True).first() if body.person else None
        course = Course.objects.filter(slug=body.course).first() if body.course else None
        if person is None and course is None:
            raise Problem(_NO_SUCH_NAME)
        return _share(
            services.recording_share(recording=recording, actor=self.person, person=person, course=course)
        )


class ShareView(RecordingBase):
    @manages("recordings_unshare", "End the sharing of a recording")
    def delete(self, recording_id: UUID, number: int) -> None:
        """For those who may change it."""
        share = get_object_or_404(self.sight(recording_id).recording.shares, pk=number)
        services.recording_unshare(share=share, actor=self.person)


class ViewsView(RecordingBase):
    @reads(
        "recordings_views",
        "Read what pages showed",
        scope=Scope.TOPICS,
        content_type="application/json",
        refuses=(404, 503),
    )
    def get(self, recording_id: UUID, query: ViewsAsked) -> HttpResponse:
        """`views`: each a time, a `View`, the stick position or null. `until_s`: the answer ends there; ask again."""
        sight = self.sight(recording_id)
        with self.contents(sight) as contents:
            views = replay.views(sight, contents, query.from_, query.to)
        return HttpResponse(views, content_type="application/json")


class PictureView(RecordingBase):
    @reads(
        "recordings_picture",
        "Read a picture of a recording",
        scope=Scope.TOPICS,
        content_type="image/jpeg image/png",
        refuses=(404, 503),
    )
    def get(self, recording_id: UUID, query: PictureAsked) -> HttpResponse:
        """The last one until a moment; the header `Fleet-At-S` has its time."""
        sight = self.sight(recording_id)
        with self.contents(sight) as contents:
            at_s, message = replay.picture(sight, contents, query.topic, query.at)
        form, picture = pictures.encoded(message)
        return HttpResponse(picture, content_type=form, headers={"Fleet-At-S": f"{at_s:.3f}"})


class SeriesView(RecordingBase):
    @reads("recordings_series", "Read numbers of a recorded topic", scope=Scope.TOPICS, refuses=(404, 503))
    def get(self, recording_id: UUID, query: SeriesAsked) -> replay.RecordedSeries:
        """At most 2,000, evenly chosen."""
        sight = self.sight(recording_id)
        with self.contents(sight) as contents:
            return replay.series(sight, contents, query.topic, query.field, query.from_, query.to)


class FileView(RecordingBase):
    @reads(
        "recordings_file",
        "Download a recording",
        scope=Scope.TOPICS,
        content_type="application/octet-stream",
        refuses=(404, 503),
    )
    def get(self, recording_id: UUID, query: FileAsked) -> HttpResponseBase:
        """Whole, cut in time, or chosen topics; as MCAP or as a bag. Answers `Range`.

        On record, once however often it is continued.
        """
        sight = self.sight(recording_id)
        topics = query.topics.split(",") if query.topics else None
        wanted = downloads.Wanted(query.format, query.from_, query.to, topics, query.pictures)
        try:
            found = downloads.download(sight, wanted, self.person)
        except OSError as error:
            raise FileAway from error
        name = downloads.name_of(sight, wanted)
        answer = ranged_file(self.request, *found, name, "application/octet-stream")
        if answer.status_code != HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            continues = not answer.headers.get("Content-Range", "bytes 0-").startswith("bytes 0-")
            services.recording_downloaded(
                recording=sight.recording, wanted=wanted, actor=self.person, continues=continues
            )
        return answer


class ThumbnailView(RecordingBase):
    @reads("recordings_thumbnail", "Read the small picture", content_type="image/jpeg", refuses=(404, 503))
    def get(self, recording_id: UUID) -> HttpResponse:
        """Of the moment of the event, or of the beginning."""
        sight = self.sight(recording_id)
        if not sight.whole or not sight.recording.thumbnail:
            raise Problem(NOT_FOUND)
        with stores.open_thumbnail(sight.recording) as stream:
            return HttpResponse(stream.read(), content_type="image/jpeg")


def _share(share: RecordingShare) -> ShareEntry:
    return ShareEntry(
        share.pk, share.person.username if share.person else None, share.course.slug if share.course else None
    )
