"""Pages of access: courses, invitations, robot groups, qualifications, tokens, and where a person's roles come from."""
