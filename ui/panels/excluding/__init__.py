"""Parts of the capture that training never sees: menus, painting over pictures, and how they are shown."""
