"""Moving obstacles: what arrived where earlier scans saw free space, followed and forecast (docs/gate.md, 10)."""
