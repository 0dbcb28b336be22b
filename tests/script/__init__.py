"""The whole console as processes: demo, programs, database faults, overload, figures of the benchmarks."""
