"""Robots: their registry, the bridge process of each, and the links between web processes and bridges."""
