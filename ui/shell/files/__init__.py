"""Dialogs about the files of a project."""
