# SPDX-License-Identifier: Apache-2.0
"""The bound of a rate. campaigns/flips/run.py imports it here, because its text is part of the judge."""

from tb.lib.bound import SURE, at_most, words

__all__ = ["SURE", "at_most", "words"]
