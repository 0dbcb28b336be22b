"""Times have 24 hours and show their zone, in the admin and on every page."""

DATETIME_FORMAT = "j. M Y, H:i T"
SHORT_DATETIME_FORMAT = DATETIME_FORMAT
TIME_FORMAT = "H:i"
