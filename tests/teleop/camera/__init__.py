"""Camera pictures to pages: sockets, quality, viewers."""
