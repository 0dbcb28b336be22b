"""Geometry of the gate: arcs, footprints, swept areas."""
