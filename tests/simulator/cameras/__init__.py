"""Pictures of the simulated cameras, and the time that is drawn into them."""
