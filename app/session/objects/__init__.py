"""Objects of the open project: volumes that follow them."""
