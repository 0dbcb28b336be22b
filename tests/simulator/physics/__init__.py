"""Physics of the simulated base, and its mux."""
