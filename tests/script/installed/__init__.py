"""The console as an administrator installs it: on an empty Debian 12, and in containers."""
