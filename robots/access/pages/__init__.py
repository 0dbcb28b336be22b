"""Pages of access: courses, joining by invitation, robot groups, qualifications, and why a person may do something."""
