"""The safety gate: limits, the arm as part of the footprint, texts of verdicts."""
