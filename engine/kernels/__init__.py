"""Shared by all kernels: vector lanes, routines, threads, memory, and where compiled code is kept."""
