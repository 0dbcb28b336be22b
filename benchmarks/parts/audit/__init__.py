"""Parts of benchmarks about the audit log: written histories, recording, and the comparison of log and robot."""
