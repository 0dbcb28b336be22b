"""People: accounts, signing in and out, the list of a person's sign-ins."""
