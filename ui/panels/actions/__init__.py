"""Everything a user can do by key, menu or palette: one file per topic, one table of all of them."""
