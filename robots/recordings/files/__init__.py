"""The files of recordings (MCAP), without Django: what is in them, parts of them, and other formats."""
