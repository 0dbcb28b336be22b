"""Records that web processes write: refusals, camera viewers, repeated events as one."""
