"""Long captures with known truth, in which exposures drift or the light changes: what they are, and how to write them.

Every change is applied to the same clean pictures and gets the same sensor noise, so that captures differ by nothing
else. `make_long_scene` and `make_change` say what is true, `write_long_captures` writes folders that the program opens.
"""
