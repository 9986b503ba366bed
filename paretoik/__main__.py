"""``python -m paretoik`` is ``paretoik``."""

from __future__ import annotations

from paretoik.cli import main

if __name__ == "__main__":
    main()
