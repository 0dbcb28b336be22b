"""Access: which person may use which robot. Roles, robot groups, courses, qualifications."""
