"""Movers: what arrived, how it is followed, and how the gate slows for it."""
