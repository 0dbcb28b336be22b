"""Messages between web processes and the processes of a robot: its bridge, cameras, tap and shelf of recordings."""
