"""Limits on connections and requests: a class fits behind one address, and a stranger cannot lock people out."""

import pytest

from fleet.base.web.network_addresses import network_of
from fleet.server.connections import Connections, Places


@pytest.fixture
def connections():
    return Connections(most=4, most_of_address=3)


def test_the_oldest_that_waits_leaves_for_a_new_one(connections):
    for number in range(4):
        assert connections.admit(number, f"address {number % 2}") == (True, None)
    connections.working(0)
    assert connections.admit("new", "address 2") == (True, 1)
    assert len(connections) == 4


def test_an_address_that_has_many_makes_room_among_its_own(connections):
    connections.admit("other", "another")
    for number in range(3):
        connections.admit(number, "one")
    assert connections.admit("new", "one") == (True, 0)


def test_connections_that_work_are_never_sent_away(connections):
    for number in range(4):
        connections.admit(number, None)
        connections.working(number)
    assert connections.admit("new", "address") == (False, None)
    connections.left(2)
    assert connections.admit("new", "address") == (True, None)


def test_one_that_was_answered_waits_again(connections):
    for number in range(4):
        connections.admit(number, None)
        connections.working(number)
    connections.waiting(3)
    assert connections.admit("new", "address") == (True, 3)
    connections.waiting(3)  # the client has gone
    assert connections.admit("newer", "address") == (True, "new")


def test_a_place_is_given_back(connections):
    places = Places(most=3, most_of_address=2)
    assert places.take("one")
    assert places.take("one")
    assert not places.take("one")
    assert places.take("another")
    assert not places.take("a third")
    places.give_back("one")
    assert places.take("a third")
    places.give_back("one")
    places.give_back("another")
    assert not places.take("a third", 2)
    assert places.take("one", 2)


@pytest.mark.parametrize(
    ("address", "network"),
    [
        ("10.0.0.7", "10.0.0.7"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2::9", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("::ffff:10.0.0.7", "10.0.0.7"),
        ("no address", "no address"),
    ],
)
def test_a_network_of_ipv6_counts_as_one_address(address, network):
    assert network_of(address) == network
