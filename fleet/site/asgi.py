"""The ASGI application of the web process.

`python -m fleet.server` serves it, with limits for unknown clients.
"""

import gc
import os
import sys

import django
from channels.routing import ProtocolTypeRouter, URLRouter

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "fleet.settings")
django.setup(set_prefix=False)

from django.db import connections  # noqa: E402 - Django's apps are ready only now
from django.urls import resolve  # noqa: E402

from fleet.base.environment import limit_queries  # noqa: E402
from fleet.site.handler import OneThreadHandler, PagesHandler  # noqa: E402
from fleet.site.websocket_handshake import guarded  # noqa: E402
from fleet.site.websockets import websocket_urlpatterns  # noqa: E402
from robots.shared.processes.shutdown import exit_within  # noqa: E402
from teleop.alerts.watch import AlertWatch  # noqa: E402
from teleop.stop.door import StopDoor  # noqa: E402

limit_queries(connections.settings["default"])
resolve("/stop-all/")  # loads the code of all URLs, so that the first stop does not wait 0.1 s for it

PAGES = "--life-line" in sys.argv  # in `fleet.server.pages.server`
if PAGES:
    connections.settings["default"].update(CONN_MAX_AGE=60, CONN_HEALTH_CHECKS=True)
    AlertWatch().start()
else:
    # Drive input goes through the event loop. With Python's default, 5 ms, it would wait for database calls.
    sys.setswitchinterval(0.0005)

# At shutdown Daphne waits for every thread, and a thread may wait for a database that does not answer.
END_S = 5.0
if "daphne.server" in sys.modules:  # Daphne has chosen the reactor
    from twisted.internet import reactor

    reactor.addSystemEventTrigger("before", "shutdown", exit_within, END_S)

    from fleet.server.front import Front
    from teleop.live.metrics import own_metrics
    from teleop.stop.rights import rights

    Front.rights, Front.metrics = rights, staticmethod(own_metrics)

# The loaded code's objects are never garbage: without this, each full collection checks them all, for 60 ms.
gc.collect()
gc.freeze()

application = ProtocolTypeRouter(
    {
        "http": PagesHandler() if PAGES else StopDoor(OneThreadHandler()),
        "websocket": guarded(URLRouter(websocket_urlpatterns)),
    }
)
