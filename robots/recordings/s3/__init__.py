"""Recordings in an S3-compatible object store: reading, upload in the background, removal."""
