"""Entry of ``python -m fretwear.disk``."""

import sys

from .cli import main

sys.exit(main())
