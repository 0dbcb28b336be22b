"""Integrity of the audit log: the chain's byte form, the database's triggers, and the checks of both."""
