"""What of the capture training never sees: menus, painting over pictures, and how it is shown."""
