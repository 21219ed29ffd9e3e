"""``python -m swingid`` is the swingid command."""

from __future__ import annotations

import sys

from swingid.cli import main

if __name__ == "__main__":
    sys.exit(main())
