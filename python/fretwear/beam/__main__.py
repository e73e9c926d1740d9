"""Entry of ``python -m fretwear.beam``."""

import sys

from .cli import main

sys.exit(main())
