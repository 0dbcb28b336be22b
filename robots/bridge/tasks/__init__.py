"""Tasks except driving: motions, speech, publishing, head, and who may start them."""
