"""Changes of the document, each a function from one document to another, with their words."""
