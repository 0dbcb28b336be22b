"""Recordings: their rows, the stores of their files, retention. The recorder beside the bridge writes the files."""
