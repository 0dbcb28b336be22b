"""Addresses of the pages of bookings."""

from django.urls import path

from fleet.bookings import views

urlpatterns = [
    path("bookings/", views.bookings, name="bookings"),
    path("bookings/feed/", views.feed, name="bookings-feed"),
    path("bookings/new/", views.booking_new, name="booking-new"),
    path("bookings/next-free/", views.next_free, name="bookings-next-free"),
    path("bookings/mine/", views.bookings_mine, name="bookings-mine"),
    path("bookings/<uuid:booking_id>/", views.booking, name="booking"),
]
