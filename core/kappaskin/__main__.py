"""`python -m kappaskin` is the command `kappaskin`."""

import sys

from kappaskin.cli import main

if __name__ == "__main__":
    sys.exit(main())
