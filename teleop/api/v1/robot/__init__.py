"""One robot by REST: its state and description, control, and the requests of a program in control."""
