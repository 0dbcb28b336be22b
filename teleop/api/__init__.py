"""The REST API: `v1` has its operations; beside it are the addresses and the metrics for Prometheus."""
