"""The program as part of a desktop and of a shell."""
