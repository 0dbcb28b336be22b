"""A robot that cannot be asked, whatever it speaks."""


class Unreachable(Exception):
    """The robot does not answer, or reports a failure. The text is for people."""
