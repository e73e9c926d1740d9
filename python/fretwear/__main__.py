"""`python -m fretwear` is the command `fretwear`."""

import sys

from .cli import main

sys.exit(main())
