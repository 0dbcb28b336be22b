"""Addresses of the API, under /api/v1/. None ends with a slash; with one, they lead to the address without it."""

from __future__ import annotations

from django.contrib.auth.decorators import login_not_required
from django.urls import path, re_path
from drf_spectacular.views import SpectacularJSONAPIView

from teleop.api.v1 import bookings, control, courses, events, other, registry, robots, tasks, topics, views
from teleop.stop import views as stop_views

urlpatterns = [
    path("openapi.json", login_not_required(SpectacularJSONAPIView.as_view()), name="api-schema"),
    path("reference", views.reference, name="api-reference"),
    path("events", events.EventsView.as_view()),
    path("profiles", registry.ProfilesView.as_view()),
    path("registry", registry.RegisterView.as_view()),
    path("registry/<slug:slug>", registry.RegistrationView.as_view()),
    path("robots", robots.RobotsView.as_view(), name="api-robots"),
    path("robots/<slug:slug>", robots.RobotView.as_view(), name="api-robot"),
    path("robots/<slug:slug>/phrases", robots.PhrasesView.as_view(), name="api-phrases"),
    path("robots/<slug:slug>/speech/history", robots.SpeechHistoryView.as_view(), name="api-speech"),
    path("robots/<slug:slug>/control", control.ControlView.as_view()),
    path("robots/<slug:slug>/control/renew", control.RenewView.as_view()),
    path("robots/<slug:slug>/control/line", control.AskView.as_view()),
    path("robots/<slug:slug>/control/hand-over", control.HandOverView.as_view()),
    path("robots/<slug:slug>/velocity", control.VelocityView.as_view()),
    path("robots/<slug:slug>/speech", tasks.SpeechView.as_view()),
    path("robots/<slug:slug>/motions", tasks.MotionsView.as_view()),
    path("robots/<slug:slug>/motions/<str:name>", tasks.MotionView.as_view()),
    path("robots/<slug:slug>/motion", tasks.MotionCancelView.as_view()),
    path("robots/<slug:slug>/drive-by", tasks.DriveByView.as_view()),
    path("robots/<slug:slug>/forget", topics.ForgetView.as_view()),
    path("robots/<slug:slug>/topics", topics.TopicsView.as_view()),
    path("robots/<slug:slug>/topics/definition", topics.DefinitionView.as_view()),
    path("robots/<slug:slug>/topics/message", topics.MessageView.as_view()),
    path("robots/<slug:slug>/topics/publish", topics.PublishView.as_view()),
    path("robots/<slug:slug>/services/definition", topics.ServiceView.as_view()),
    path("robots/<slug:slug>/services/call", topics.CallView.as_view()),
    path("robots/<slug:slug>/parameters", topics.ParametersView.as_view()),
    path("robots/<slug:slug>/parameters/value", topics.ParameterView.as_view()),
    path("robots/<slug:slug>/inputs/<str:use>", topics.InputView.as_view()),
    path("robots/<slug:slug>/look-ahead", tasks.LookAheadView.as_view()),
    path("robots/<slug:slug>/tasks/<int:number>", tasks.TaskView.as_view()),
    path("robots/<slug:slug>/stop/clear", tasks.ClearView.as_view()),
    path("robots/<slug:slug>/stop", stop_views.rest_stop, name="api-stop"),
    path("stop", stop_views.rest_stop_all, name="api-stop-all"),
    path("bookings", bookings.BookingsView.as_view()),
    path("bookings/free", bookings.FreeView.as_view()),
    path("bookings/<uuid:booking_id>", bookings.BookingView.as_view()),
    path("bookings/<uuid:booking_id>/hand-over", bookings.HandBookingView.as_view()),
    path("bookings/<uuid:booking_id>/approve", bookings.ApproveView.as_view()),
    path("bookings/<uuid:booking_id>/accept", bookings.AcceptView.as_view()),
    path("waiting", bookings.WaitingView.as_view()),
    path("waiting/<int:number>", bookings.WaitingOneView.as_view()),
    path("courses", courses.CoursesView.as_view()),
    path("courses/<slug:slug>", courses.CourseView.as_view()),
    path("courses/<slug:slug>/members", courses.MembersView.as_view()),
    path("courses/<slug:slug>/members/<str:username>", courses.MemberView.as_view()),
    path("courses/<slug:slug>/qualifications/<slug:qualification>/grant", courses.GrantView.as_view()),
    path("courses/<slug:slug>/qualifications/<slug:qualification>/revoke", courses.RevokeView.as_view()),
    # A stop is not led elsewhere because of a slash.
    path("robots/<slug:slug>/stop/", stop_views.rest_stop),
    path("stop/", stop_views.rest_stop_all),
    re_path(r"^(?P<address>.*)$", other.OtherAddress.as_view(schema=None)),
]
