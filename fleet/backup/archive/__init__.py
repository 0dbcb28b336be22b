"""The file of a backup: tar, compressed, encrypted in the format of age if asked, whole or not there."""
