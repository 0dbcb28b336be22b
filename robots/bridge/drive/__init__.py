"""Drive input: newest stick position, input filters, twists, drives by a distance or angle, and the log of drives."""
