"""Parts that several benchmarks share: processes that observe, publish, read and carry bytes; priority."""
