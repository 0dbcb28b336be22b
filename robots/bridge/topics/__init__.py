"""Client of the inspector process, which reads a robot's topics for people."""
