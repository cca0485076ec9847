"""Benchmarks, ablations, reports, and the generator of synthetic captures; the product never imports them."""
