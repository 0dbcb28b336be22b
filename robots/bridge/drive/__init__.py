"""Drive input: newest stick position, input filters, twists, and the log of drives."""
