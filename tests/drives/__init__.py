"""Whole drives in simulated worlds, without processes. They take long: `script/test quick` leaves them out."""
