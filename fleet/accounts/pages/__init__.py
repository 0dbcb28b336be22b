"""A person's own pages: account, settings, list of sign-ins; and all addresses under /accounts/."""
