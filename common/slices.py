"""Slices of the configuration as a stage reads them."""

import hashlib
import json
import os
import re
from pathlib import Path

from common.errors import InputError

OURS = "slices stand in results/<mine>/slices; a run writes deleted ones again"


def content_hash(text: str) -> str:
    """The end of the name of a slice's file."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def read_slice(path: str | os.PathLike) -> dict:
    """The slice that a stage is given: a file with one JSON object, in whose name its content's hash may stand.

    Raises InputError for what is none, and for a file whose content is not of its name.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
        values = json.loads(text)
    except OSError as error:
        raise InputError(f"{path}: not readable ({error.strerror}); {OURS}") from error
    except ValueError as error:
        raise InputError(f"{path}: not JSON ({error}); {OURS}") from error
    if not isinstance(values, dict):
        raise InputError(f"{path}: not a JSON object; {OURS}")
    named = re.fullmatch(r"\.([0-9a-f]{16})", Path(path.stem).suffix)
    if named and named[1] != content_hash(text):
        raise InputError(f"{path}: damaged: its content is not what was written; {OURS}")
    return values
