"""How many pictures of a trained project are rendered per second, by the rasterizer and by the window's OpenGL."""
