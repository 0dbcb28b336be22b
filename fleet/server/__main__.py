"""`python -m fleet.server`, with the command line of `daphne`."""

from fleet.server.command import CommandLine

CommandLine.entrypoint()
