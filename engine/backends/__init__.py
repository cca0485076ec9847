"""Back ends: everything that a clip is decoded, drawn, compared and updated with, chosen together and once a process.

`engine.backends.table` chooses; nothing else in the engine does, it is handed one. A new one is a folder here, with a
class that has the operations of `engine.backends.backend.Backend`, and one line in the table.
"""
