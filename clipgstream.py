"""The Python API of ClipGStream Studio, under the name of the program: everything that app.scripting offers."""

from app.scripting import *  # noqa: F403 - the same names
from app.scripting import __all__ as __all__
