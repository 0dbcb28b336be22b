"""Pages of access: courses, invitations, robot groups, qualifications, tokens, and why a person may do something."""
