# SPDX-License-Identifier: Apache-2.0
"""Seeds of the random tests: each test prints its seed; COCOTB_RANDOM_SEED=n repeats it."""

from __future__ import annotations

import os
import random


def seeded(what: str) -> random.Random:
    """A random generator for `what` alone; prints the seed that repeats it."""
    seed = int(os.environ.get("COCOTB_RANDOM_SEED") or random.randrange(1 << 31))
    print(f"random {what}: repeat with COCOTB_RANDOM_SEED={seed}")
    return random.Random(f"{what}/{seed}")
