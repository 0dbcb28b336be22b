"""Access: who may use which robot. Roles, robot groups, courses, qualifications."""
