"""The bridge's end of the links: the server, and flood limits."""
