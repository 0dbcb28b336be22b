"""Constraints of the database that refuse two overlapping bookings of one robot.

PostgreSQL has an exclusion constraint, SQLite two triggers. Both compare the half-open interval from `starts_at` to
`held_until`, which is empty for a booking that was cancelled in time. The errors of both contain `NAME`.
"""

NAME = "bookings_do_not_overlap"

_TAKEN = f"""
    NEW.held_until > NEW.starts_at AND EXISTS (
        SELECT 1 FROM bookings_booking AS other
        WHERE other.robot_id = NEW.robot_id AND other.id <> NEW.id
        AND other.starts_at < NEW.held_until AND other.held_until > NEW.starts_at
        AND other.held_until > other.starts_at
    )
    BEGIN SELECT RAISE(ABORT, '{NAME}'); END
"""  # noqa: S608  # no part of it comes from outside

TRIGGERS = {
    f"{NAME}_insert": f"CREATE TRIGGER {NAME}_insert BEFORE INSERT ON bookings_booking WHEN {_TAKEN}",
    f"{NAME}_update": f"CREATE TRIGGER {NAME}_update BEFORE UPDATE ON bookings_booking WHEN {_TAKEN}",
}

CREATE = {
    "sqlite": list(TRIGGERS.values()),
    "postgresql": [
        "CREATE EXTENSION IF NOT EXISTS btree_gist",
        f"""
        ALTER TABLE bookings_booking ADD CONSTRAINT {NAME}
        EXCLUDE USING gist (robot_id WITH =, tstzrange(starts_at, held_until) WITH &&)
        """,
    ],
}
