"""The REST API: `v1` has its operations.

Beside it: the addresses (`urls.py`), the metrics for Prometheus (`metrics.py`), and those of the other web and pages
processes (`web_processes.py`).
"""
