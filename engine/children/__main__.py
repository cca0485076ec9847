"""Entry point of every child process, see engine.children.child."""

import sys

from engine.children.child import main

main(*sys.argv[1:])
