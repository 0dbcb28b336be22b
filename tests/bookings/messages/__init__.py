"""Letters and calendar feeds."""
