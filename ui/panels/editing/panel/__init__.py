"""The panel Edit, section by section."""
