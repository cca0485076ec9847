"""Mending as a job: a request, the process that carries it out, and what becomes of its result."""
