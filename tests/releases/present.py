"""Run by the code of this release: print what its pages and checks say about the database."""

# ruff: noqa: E402

import json

import django

django.setup()

from django.conf import settings
from django.db import connection
from django.test import Client

from fleet.accounts.models import User
from fleet.audit.integrity import triggers
from fleet.audit.integrity.verify import verify
from fleet.audit.models import Chain


def page(client, path):
    return client.get(path, headers={"host": settings.ALLOWED_HOSTS[0]})


if __name__ == "__main__":
    staff, ada = Client(), Client()
    staff.force_login(User.objects.get(username="sam"))
    ada.force_login(User.objects.get(username="ada"))
    paths = ["/", "/robots/tiago-7/", "/your-data/", "/bookings/", "/about/"]
    found = {
        "findings": [str(one) for one in verify(Chain.objects.all()).findings],
        "triggers": triggers.amiss(connection),
        "health": page(Client(), "/healthz").json(),
        "pages": {path: page(ada, path).status_code for path in paths},
        "report": page(staff, "/robots/tiago-7/report/").status_code,
        "log": page(staff, "/admin/audit/record/?q=Hello").status_code,
    }
    print(json.dumps(found))
