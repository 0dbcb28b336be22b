"""Figures and models of the benchmarks."""
