"""What benchmarks share: processes that watch, publish, look and carry bytes."""
