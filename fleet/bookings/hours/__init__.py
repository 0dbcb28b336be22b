"""Sums of hours on robots: booked, used, not used, and the time that is left of each quota."""
