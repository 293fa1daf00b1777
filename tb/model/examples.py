# SPDX-License-Identifier: Apache-2.0
"""The worked examples of Danfoss's documents by id, from examples.json: requests, telegrams, replies."""

from __future__ import annotations

import json
from pathlib import Path

EXAMPLES = {example["id"]: example for example in json.loads(Path(__file__).with_suffix(".json").read_text())}
