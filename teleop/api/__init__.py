"""The REST API: `v1` has its operations.

The other modules: the addresses (`urls.py`), the metrics for Prometheus (`metrics.py`), and the metrics of
the other web and pages processes (`web_processes.py`).
"""
