"""All URLs of the console, and the demo's door."""

from django.urls import path

from fleet.site.urls import *  # noqa: F403
from fleet.site.urls import urlpatterns as of_console
from script.stack.door.views import DoorView

urlpatterns = [path("accounts/sign-in/demo/", DoorView.as_view(), name="demo-door"), *of_console]
