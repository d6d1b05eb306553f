"""`python -m asperity` is the command `asperity`."""

from asperity.cli import main

main()
