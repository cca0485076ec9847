"""Training on several computers through Ray, which is an extra: nothing here imports it before it is used."""
