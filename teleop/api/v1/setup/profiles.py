"""Profiles, the kinds of robots, and ready-made phrases. Everybody reads them; staff change them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal

from django.db import transaction
from django.shortcuts import get_object_or_404
from msgspec import UNSET, Meta, Struct, UnsetType, structs
from rest_framework.response import Response

from robots.registry.models import Robot, RobotProfile
from robots.registry.phrases import (
    MOST_PHRASES,
    Line,
    in_usual_case,
    why_no_language,
    why_no_phrase,
    why_no_tags,
)
from robots.registry.services import phrases_import, profile_save
from robots.shared.sentences import say
from robots.shared.wire import Refusal
from teleop.api.v1.framework.operation import entry_of, reads
from teleop.api.v1.framework.parameters import Time
from teleop.api.v1.framework.problems import Problem
from teleop.api.v1.setup.base import SetupView, edits, faults_named, locked

Topic = Annotated[str, Meta(max_length=200)]


class ProfileEntry(Struct, frozen=True):
    """A kind of robots."""

    slug: str
    name: str


class ProfileList(Struct, frozen=True):
    """Profiles, by name."""

    profiles: list[ProfileEntry]


class ProfileDetail(ProfileEntry, frozen=True):
    """A profile with its content. The structured parts are as in the admin, which explains them."""

    holonomic: bool
    forward_mps: float
    reverse_mps: float
    lateral_mps: float
    turn_radps: float
    linear_mps2: float
    angular_radps2: float
    blind_mps: float  # in directions that no sensor sees
    default_share: float
    reverse_steering: str
    drive_topic: str
    drive_type: str
    footprint: dict[str, Any]  # m, base frame
    topics: dict[str, Any]
    gate: dict[str, Any]  # parameters that differ from the defaults
    stick: list[dict[str, Any]]  # filter steps
    updated_at: Time


class ProfileChange(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Fields that are left out stay as they are."""

    name: Annotated[str, Meta(min_length=1, max_length=80)] | UnsetType = UNSET
    holonomic: bool | UnsetType = UNSET
    forward_mps: float | UnsetType = UNSET
    reverse_mps: float | UnsetType = UNSET
    lateral_mps: float | UnsetType = UNSET
    turn_radps: float | UnsetType = UNSET
    linear_mps2: float | UnsetType = UNSET
    angular_radps2: float | UnsetType = UNSET
    blind_mps: float | UnsetType = UNSET
    default_share: float | UnsetType = UNSET
    reverse_steering: Literal["turn", "car"] | UnsetType = UNSET
    drive_topic: Topic | UnsetType = UNSET
    drive_type: Topic | UnsetType = UNSET
    footprint: dict[str, Any] | UnsetType = UNSET
    topics: dict[str, Any] | UnsetType = UNSET
    gate: dict[str, Any] | UnsetType = UNSET
    stick: list[dict[str, Any]] | UnsetType = UNSET


class PhraseText(Struct, frozen=True, forbid_unknown_fields=True):
    """A sentence."""

    text: Annotated[str, Meta(min_length=1, max_length=500)]
    language: Annotated[str, Meta(min_length=2, max_length=35)]  # BCP 47, such as en-GB
    tags: Annotated[list[str], Meta(max_length=20)] = []


class PhraseTexts(Struct, frozen=True, forbid_unknown_fields=True):
    """All phrases of a profile, or those that one robot has beside them, in their order."""

    phrases: Annotated[list[PhraseText], Meta(max_length=MOST_PHRASES)]


class ProfilesView(SetupView):
    tag = "registry"

    @reads("profiles_list", "List the kinds of robots", refuses=())
    def get(self) -> ProfileList:
        """By name."""
        return ProfileList([entry_of(ProfileEntry, one) for one in RobotProfile.objects.order_by("name")])


class ProfilesBase(SetupView):
    tag = "registry"

    def concerned(self, slug: str, **_asked: Any) -> Iterable[Robot]:
        return self.profile(slug).robots.all()

    def profile(self, slug: str) -> RobotProfile:
        """Return a profile. Raises `Http404`."""
        return get_object_or_404(RobotProfile, slug=slug)

    def changeable(self, slug: str) -> RobotProfile:
        """Return a profile, for staff. Raises `Problem` or `Http404`."""
        self.staff()
        return self.profile(slug)


class ProfileView(ProfilesBase):
    @reads("profiles_read", "Read a profile", answer=ProfileDetail)
    def get(self, slug: str) -> Response:
        """Limits, body, ROS interface, gate and stick of this kind of robots."""
        return self.tagged(entry_of(ProfileDetail, self.profile(slug)))

    @edits("profiles_change", "Change a profile", answer=ProfileDetail)
    def patch(self, slug: str, body: ProfileChange) -> Response:
        """For staff. Bridges of its robots start again, and robots that move stop for it."""
        with faults_named(), transaction.atomic():
            found = locked(self.changeable(slug))
            self.require_unchanged(entry_of(ProfileDetail, found))
            for name, value in structs.asdict(body).items():
                if value is not UNSET:
                    setattr(found, name, value)
            profile_save(profile=found, actor=self.staff())
        return self.tagged(entry_of(ProfileDetail, self.profile(slug)))


class PhrasesBase(ProfilesBase):
    """Base of the views of phrases."""

    def replaced(self, owner: RobotProfile | Robot, body: PhraseTexts) -> Response:
        """Replace phrases, if nobody changed them after the client read them. Raises `Problem`."""
        with transaction.atomic():
            locked(owner)
            self.require_unchanged(_phrases(owner))
            phrases_import(owner=owner, lines=_lines(body), actor=self.staff(), replace=True)
        return self.tagged(_phrases(owner))


class ProfilePhrasesView(PhrasesBase):
    @reads("profiles_phrases_read", "Read a profile’s phrases", answer=PhraseTexts)
    def get(self, slug: str) -> Response:
        """In their order."""
        return self.tagged(_phrases(self.profile(slug)))

    @edits("profiles_phrases_set", "Replace a profile’s phrases", answer=PhraseTexts)
    def put(self, slug: str, body: PhraseTexts) -> Response:
        """For staff."""
        return self.replaced(self.changeable(slug), body)


class RobotPhrasesView(PhrasesBase):
    def concerned(self, slug: str, **_asked: Any) -> Iterable[Robot]:
        return [self.robot(slug)]

    @reads("registry_phrases_read", "Read the phrases that only one robot has", answer=PhraseTexts)
    def get(self, slug: str) -> Response:
        """In addition to the phrases of its profile."""
        return self.tagged(_phrases(self.robot(slug)))

    @edits("registry_phrases_set", "Replace the phrases that only one robot has", answer=PhraseTexts)
    def put(self, slug: str, body: PhraseTexts) -> Response:
        """For staff."""
        self.staff()
        return self.replaced(self.robot(slug), body)


def _lines(body: PhraseTexts) -> list[Line]:
    """Return the phrases as lines for the services. Raises `Problem`, which names the first wrong phrase."""
    lines = []
    for number, one in enumerate(body.phrases, start=1):
        tags = tuple(one.tags)
        why = why_no_language(one.language) or why_no_phrase(one.text) or why_no_tags(tags)
        if why is not None:
            raise Problem(
                Refusal(
                    "invalid",
                    say("Phrase {number}: {why}", number=number, why=why),
                    "wire",
                    {"phrase": number},
                )
            )
        lines.append(Line(one.text, in_usual_case(one.language), tags))
    return lines


def _phrases(owner: RobotProfile | Robot) -> PhraseTexts:
    lines = [phrase.line for phrase in owner.phrases.all()]
    return PhraseTexts([PhraseText(one.text, one.language, list(one.tags)) for one in lines])
