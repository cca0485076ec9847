"""From a decoded picture to one that training takes: lenses, masks, colours, sizes."""
