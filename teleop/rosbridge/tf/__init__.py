"""tf for clients, as tf2_web_republisher gives it: `tree` knows the frames, `republisher` answers and sends."""
