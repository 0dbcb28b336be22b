"""Writers of files in the repository: screenshots, drawings, icons, docs of messages."""
