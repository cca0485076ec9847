"""Child processes that compute apart from this one: started, watched, ended with it."""
