"""Parts of the capture that training never sees, as a user deals with them."""
