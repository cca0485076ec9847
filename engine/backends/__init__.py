"""Back ends: everything that a clip is decoded, drawn, compared and updated with, chosen together and once.

Entry points ask `engine.backends.table.backend_called` for one by name and hand it down. A new one is a folder here,
with a class that has the operations of `engine.backends.backend.Backend`, and one line in the table.
"""
