"""URLs of the pages of bookings."""

from django.urls import path

from fleet.bookings.pages import (
    changes,
    handing,
    holiday_views,
    lesson,
    news,
    policy_views,
    series_views,
    views,
)

urlpatterns = [
    path("bookings/", views.bookings, name="bookings"),
    path("bookings/feed/", views.feed, name="bookings-feed"),
    path("bookings/new/", views.booking_new, name="booking-new"),
    path("bookings/next-free/", views.next_free, name="bookings-next-free"),
    path("bookings/address/", views.feed_address, name="bookings-address"),
    path("bookings/ical/<str:token>.ics", views.ical, name="bookings-ical"),
    path("bookings/waiting/", views.waiting, name="bookings-waiting"),
    path("bookings/news/seen/", news.seen, name="bookings-news-seen"),
    path("bookings/mine/", views.bookings_mine, name="bookings-mine"),
    path("bookings/courses/<slug:slug>/", views.bookings_of_course, name="bookings-course"),
    path("bookings/policies/", policy_views.policies, name="booking-policies"),
    path("bookings/policies/all/", policy_views.policy, name="booking-policy-all"),
    path("bookings/policies/group/<slug:slug>/", policy_views.group_policy, name="booking-policy-group"),
    path("bookings/holidays/", holiday_views.holidays, name="holidays"),
    path("bookings/holidays/<uuid:holiday_id>/remove/", holiday_views.remove, name="holiday-remove"),
    path("bookings/policies/<slug:slug>/", policy_views.policy, name="booking-policy"),
    path("bookings/series/", policy_views.series, name="booking-series"),
    path("bookings/series/<uuid:series>/", series_views.whole_series, name="booking-whole-series"),
    path("bookings/report/", policy_views.booking_report, name="booking-report"),
    path("bookings/out-of-service/", policy_views.out_of_service, name="out-of-service"),
    path(
        "bookings/out-of-service/<uuid:period_id>/end/",
        policy_views.out_of_service_end,
        name="out-of-service-end",
    ),
    path("bookings/changes/", changes.changes, name="changes"),
    path("bookings/changes/<uuid:change_id>/", changes.change, name="change"),
    path("bookings/changes/<uuid:change_id>/undo/", changes.change_undo, name="change-undo"),
    path("bookings/hand/<uuid:offer_id>/", handing.answer, name="hand-answer"),
    path("bookings/hand/link/<str:code>/", handing.link, name="hand-link"),
    path("bookings/<uuid:booking_id>/hand/", handing.make_link, name="hand-make-link"),
    path("bookings/<uuid:booking_id>/", views.booking, name="booking"),
    path("bookings/<uuid:booking_id>/lesson/", lesson.lesson, name="lesson"),
]
