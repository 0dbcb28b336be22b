"""A person has at most ten event streams, also if they are opened at once."""

from teleop.api.v1.events import MOST_OF_PERSON
from tests.processes import until


def test_streams_that_open_at_once_keep_the_limit(crowd):
    one = crowd.head("/api/v1/events", f"Authorization: Bearer {crowd.colleagues[0]['token']}", method="GET")
    with crowd.flood([one] * (3 * MOST_OF_PERSON)) as connections:
        statuses = [connection.recv(65536).split()[1] for connection in connections]
        assert (statuses.count(b"200"), statuses.count(b"429")) == (MOST_OF_PERSON, 2 * MOST_OF_PERSON)
        other = one.replace(crowd.colleagues[0]["token"].encode(), crowd.colleagues[1]["token"].encode())
        with crowd.flood([other]) as [connection]:
            assert connection.recv(65536).split()[1] == b"200"

    def opens():
        with crowd.flood([one]) as [connection]:
            return connection.recv(65536).split()[1] == b"200"

    until(opens, "closed streams give their places back", 30)
