"""The black box: the ring of the last minute, and the events at which it is kept."""
