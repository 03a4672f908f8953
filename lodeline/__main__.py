"""`python -m lodeline` is the command `lodeline`."""

import sys

from lodeline.cli import main

sys.exit(main())
