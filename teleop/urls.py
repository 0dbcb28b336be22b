"""Addresses of the pages of this app."""

from django.urls import path

from teleop import views
from teleop.alerts import views as alert_views
from teleop.foxglove.lichtblick import lichtblick
from teleop.push import views as push_views
from teleop.recordings import views as recording_views
from teleop.reports import views as report_views
from teleop.stop import views as stop_views
from teleop.webhooks import views as webhook_views

urlpatterns = [
    path("", views.fleet, name="fleet"),
    path("plan/", views.plan, name="plan"),
    path("maps/<slug:digest>/places.csv", views.places_file, name="places-file"),
    path("robots/<slug:slug>/", views.control, name="control"),
    path("robots/<slug:slug>/stop/", stop_views.page_stop, name="stop"),
    path("robots/<slug:slug>/stop", stop_views.page_stop),
    path("robots/<slug:slug>/report/", report_views.robot, name="robot-report"),
    path("sessions/<uuid:session_id>/", report_views.control_session, name="control-session"),
    path(
        "sessions/<uuid:session_id>/maps/<int:number>/",
        report_views.control_session_map,
        name="control-session-map",
    ),
    path("recordings/", recording_views.recordings, name="recordings"),
    path("recordings/<uuid:recording_id>/", recording_views.recording, name="recording"),
    path("today/", report_views.today_page, name="today"),
    path("courses/<slug:slug>/marks.csv", report_views.marks_file, name="course-marks"),
    path("your-data/", report_views.your_data, name="your-data"),
    path("your-data/export/", report_views.your_data_export, name="your-data-export"),
    path("bookings/devices/", push_views.devices, name="push-devices"),
    path("bookings/devices/add/", push_views.device_add, name="push-device-add"),
    path("status/", alert_views.status, name="status"),
    path("status/rules/", alert_views.alert_rules, name="alert-rules"),
    path("webhooks/", webhook_views.webhooks, name="webhooks"),
    path("webhooks/new/", webhook_views.webhook_new, name="webhook-new"),
    path("webhooks/<uuid:webhook_id>/", webhook_views.webhook, name="webhook"),
    path("stop-all/", stop_views.page_stop_all, name="stop-all"),
    path("stop-all", stop_views.page_stop_all),
    path("lichtblick/", lichtblick, name="lichtblick"),
    path("lichtblick/<path:file>", lichtblick),
]
