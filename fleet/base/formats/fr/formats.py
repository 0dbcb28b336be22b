"""Times have 24 hours and show their zone; months are written small."""

DATETIME_FORMAT = "j b Y, H:i T"
SHORT_DATETIME_FORMAT = DATETIME_FORMAT
TIME_FORMAT = "H:i"
