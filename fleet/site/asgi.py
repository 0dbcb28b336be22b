"""The web process: `daphne fleet.site.asgi:application`."""

import os
import sys
import warnings

from channels.routing import ProtocolTypeRouter, URLRouter
from django.core.asgi import get_asgi_application

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "fleet.settings")
http = get_asgi_application()

from django.db import connections  # noqa: E402 - the applications are ready only now
from django.urls import resolve  # noqa: E402

from fleet.environment import limit_queries  # noqa: E402
from fleet.site.websocket_doors import guarded  # noqa: E402
from robots.processes.shutdown import leave_within  # noqa: E402
from teleop.live.routing import websocket_urlpatterns  # noqa: E402

limit_queries(connections.settings["default"])
resolve(
    "/stop-all/"
)  # loads the code of all addresses: else the first stop would wait a tenth of a second for it

# A stick's way leads through the event loop: at Python's usual 5 ms it would wait out each whole look at the database.
sys.setswitchinterval(0.0005)

# WhiteNoise serves files from threads, and Django says so once for each file.
warnings.filterwarnings(
    "ignore", message="StreamingHttpResponse must consume synchronous iterators", category=Warning
)

# Daphne waits for every thread, and a thread for a database that hangs.
END_S = 5.0
if "daphne.server" in sys.modules:  # which has chosen the reactor
    from twisted.internet import reactor

    reactor.addSystemEventTrigger("before", "shutdown", leave_within, END_S)

application = ProtocolTypeRouter({"http": http, "websocket": guarded(URLRouter(websocket_urlpatterns))})
