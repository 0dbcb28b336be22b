"""A master that only IPv6 reaches is not joined: the bridge goes on and says why."""

from __future__ import annotations

import pytest

from robots.shared.ros.master import MasterError, require_ipv4


@pytest.mark.parametrize("uri", ["http://[::1]:11311", "http://[fd00::7]:11311"])
def test_a_master_that_only_ipv6_reaches_is_refused_in_words(uri: str) -> None:
    with pytest.raises(MasterError, match="has no IPv4 address here, and ROS 1 needs one"):
        require_ipv4(uri)


def test_a_master_with_both_is_joined() -> None:
    require_ipv4("http://localhost:11311")
    require_ipv4("http://127.0.0.1:11311")
