"""`python -m tests.documents write`: fill the generated blocks of the documents; see `make docs`."""

import sys

from tests.documents.blocks import ROOT, write

if __name__ == "__main__":
    if sys.argv[1:] != ["write"]:
        sys.exit("usage: python -m tests.documents write")
    for path in write():
        sys.stdout.write(f"{path.relative_to(ROOT)}\n")
