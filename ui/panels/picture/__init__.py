"""The viewport and everything drawn over or around it: picture, HUD, heat maps, comparison, navigation."""
