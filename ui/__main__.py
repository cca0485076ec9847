"""`python -m ui` starts the program."""

import sys

from ui.main import main

if __name__ == "__main__":  # a spawned worker imports this module again and must not start a second window
    sys.exit(main())
