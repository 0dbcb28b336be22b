"""The bridge's end of the links: the server, and limits against floods."""
