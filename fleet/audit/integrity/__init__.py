"""Integrity of the audit log: the bytes behind a record's digest, the database's triggers, checks of both."""
