"""Recordings without people who must not be in them: names in what the chain says, and erased sessions."""
