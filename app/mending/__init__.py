"""Mending as a job: a request, the process that carries it out, and the use of its result."""
