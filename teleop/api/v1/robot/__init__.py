"""One robot by REST: its state and description, control, and all that a program in control asks of it."""
