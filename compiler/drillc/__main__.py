"""`python -m drillc`: the command line."""

import sys

from drillc.cli import main

sys.exit(main())
