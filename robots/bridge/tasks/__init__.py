"""Tasks except driving: motions, speech, publishing, head, and the rules for their start."""
