# SPDX-License-Identifier: Apache-2.0
"""Seeds of the random tests: each test prints its seed; COCOTB_RANDOM_SEED=n repeats it.

`make test` has a fixed seed, with which a long random test draws few cases. With any other it draws many.
"""

from __future__ import annotations

import os
import random

# SEED= of make gives another; CI draws one.
FIXED_SEED = 1104483726


def cases(few: int, many: int) -> int:
    """How many random cases a test draws."""
    return few if os.environ.get("COCOTB_RANDOM_SEED") == str(FIXED_SEED) else many


def seeded(what: str) -> random.Random:
    """A random generator for `what` alone; prints the seed that repeats it."""
    seed = int(os.environ.get("COCOTB_RANDOM_SEED") or random.randrange(1 << 31))
    print(f"random {what}: repeat with COCOTB_RANDOM_SEED={seed}")
    return random.Random(f"{what}/{seed}")
