"""What a robot senses, after its bytes are read: frames, depth pictures, diagnostics."""
