"""Accounts of people and programs: changes, sessions, tokens, e-mails, and erasing a person."""
