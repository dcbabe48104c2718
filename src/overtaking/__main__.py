"""`python -m overtaking` does the same as `overtaking`."""

import sys

from overtaking.cli import main

if __name__ == "__main__":
    sys.exit(main())
