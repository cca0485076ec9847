"""Benchmarks, ablations and reports; the product never imports them."""
