"""A clip on disk: typed header, named arrays, compact form."""
