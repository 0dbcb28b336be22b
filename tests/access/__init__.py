"""Rights on robots: roles, courses, enrolment, and the pages of tokens."""
