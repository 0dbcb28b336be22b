"""Every message between browser, web process and bridge, split by sender and subject.

Units are SI unless a name says otherwise; angles are radians; base frame: x forward, y left (REP 103). Joystick axes
run from -1 to 1. `page`, `fleet`, `tasks`, `limbs`, `navigation`, `recordings`, `state`, `health` and `topics` have the
messages by subject, `links` those between processes; `base` has the shared parts; `codec` and `decoders` decode and
validate. An invalid message raises `WireError` with the `Refusal` to answer.

The bridge encodes a view (`View`) once, and the web process forwards the bytes without decoding them. On the link,
views are the only binary frames.
"""

# ruff: noqa: F403 - the names of the package are all those that its modules define
from robots.shared.wire.base import *
from robots.shared.wire.codec import *
from robots.shared.wire.decoders import *
from robots.shared.wire.fleet import *
from robots.shared.wire.health import *
from robots.shared.wire.limbs import *
from robots.shared.wire.links.bridge import *
from robots.shared.wire.links.camera import *
from robots.shared.wire.links.shelf import *
from robots.shared.wire.links.tap import *
from robots.shared.wire.navigation import *
from robots.shared.wire.page import *
from robots.shared.wire.recordings import *
from robots.shared.wire.state import *
from robots.shared.wire.tasks import *
from robots.shared.wire.topics import *
