"""Who may use which robot: roles, courses, enrolment, and the pages of tokens."""
