"""Tasks except driving: their protocol, motions, speech, publishing, and the rules for their start."""
