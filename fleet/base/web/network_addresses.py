"""Addresses of clients."""

from __future__ import annotations

from functools import lru_cache
from ipaddress import IPv6Address, ip_address, ip_network


@lru_cache(4096)
def network_of(address: str) -> str:
    """Return the address for which a client counts: of IPv6 its network of 64 bits, of which one client has all."""
    try:
        found = ip_address(address.partition("%")[0])
    except ValueError:  # from a proxy's header
        return address
    if not isinstance(found, IPv6Address):
        return address
    if found.ipv4_mapped is not None:
        return str(found.ipv4_mapped)
    return str(ip_network((found, 64), strict=False))
