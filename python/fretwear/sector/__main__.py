"""Entry of ``python -m fretwear.sector``."""

import sys

from .cli import main

sys.exit(main())
