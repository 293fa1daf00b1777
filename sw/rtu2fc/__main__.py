# SPDX-License-Identifier: Apache-2.0
"""`python -m rtu2fc`, and the command `rtu2fc`. Ctrl-C may come while the rest of it is imported."""

import sys


def main() -> int:
    try:
        from .cli import main as command

        return command()
    except KeyboardInterrupt:
        print("rtu2fc: stopped by Ctrl-C", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
