"""Writes files of the repository: screenshots, drawings, icons, docs of messages."""
