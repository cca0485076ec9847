"""How Gaussians and anchors are selected, in a panel and with the pointer."""
