"""Features of pictures and their matches, by pycolmap in child processes: pycolmap never enters the program itself."""
