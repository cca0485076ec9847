"""PlainParser: argparse that says what is wrong in one line. Knows no option of any command."""

from __future__ import annotations

import argparse
from typing import NoReturn

EXIT_BAD_INPUT = 2


class PlainParser(argparse.ArgumentParser):
    """Says what is wrong in one line and how to get help."""

    def error(self, message: str) -> NoReturn:
        """End the program with exit code 2 and one line."""
        self.exit(EXIT_BAD_INPUT, f"{self.prog}: {message}. See `{self.prog} --help`.\n")
