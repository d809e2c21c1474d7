"""`python -m drake_polygrasp` is `polygrasp`."""

import sys

from drake_polygrasp.cli import main

sys.exit(main())
