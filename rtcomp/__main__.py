"""`python -m rtcomp` is `rtcomp`."""

from __future__ import annotations

from rtcomp.cli.main import main

if __name__ == "__main__":
    main()
