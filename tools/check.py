"""The one check command: style, format, types, layers, tests. Runs all, says which failed, exits 1 if any.

`tools/check.py --no-tests` leaves the tests out.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent
BIN = Path(sys.executable).parent

CHECKS = {
    "style": [sys.executable, "-m", "ruff", "check", "."],
    "format": [sys.executable, "-m", "ruff", "format", "--check", "."],
    "types": [sys.executable, "-m", "mypy"],
    "layers": [str(BIN / "lint-imports")],
    "tests": [sys.executable, "-m", "pytest", "-m", "not slow", "-n", "2", "--dist", "loadfile"],
}


def main(arguments: list[str]) -> int:
    unknown = set(arguments) - {"--no-tests"}
    if unknown:
        print(f"check: unknown argument {sorted(unknown)[0]}; there is --no-tests", file=sys.stderr)
        return 2
    chosen = {name: command for name, command in CHECKS.items() if f"--no-{name}" not in arguments}
    failed = [name for name, command in chosen.items() if not passes(name, command)]
    outcome = f"{', '.join(failed)} FAILED" if failed else f"{', '.join(chosen)} passed"
    print(f"\ncheck: {outcome}", flush=True)
    return 1 if failed else 0


def passes(name: str, command: list[str]) -> bool:
    print(f"== {name}", flush=True)
    started = time.monotonic()
    status = subprocess.run(command, cwd=TOP, check=False).returncode
    print(f"== {name}: {'ok' if status == 0 else 'FAILED'}, {time.monotonic() - started:.1f} s", flush=True)
    return status == 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
