"""URLs of help."""

from django.urls import path

from fleet.help import views

urlpatterns = [
    path("", views.show, name="help"),
    path("img/<str:name>", views.picture, name="help-picture"),
    path("errors/<slug:error>/", views.error, name="help-error"),
    path("<path:name>/", views.show, name="help-page"),
]
