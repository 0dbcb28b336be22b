"""Whole drives in simulated worlds, without processes. Each computes for long: `script/test quick` leaves them out."""
