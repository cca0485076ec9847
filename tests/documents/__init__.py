"""Documents that follow from the code: blocks of Markdown are generated, and the tests compare them with the files."""
