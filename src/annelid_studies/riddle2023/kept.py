"""Pictures and what was found with them, kept while the code and the runs that they come from stay the same."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from annelid.experiment.fingerprint import code_fingerprint
from annelid.output import whole_file
from annelid.textfiles import read_json


def kept(stem: Path, made_of: Sequence[object], make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Returns what goes with a picture: as it was kept, or made anew where code, runs or picture have changed.

    Args:
        stem: Path of the picture without suffix; ``<stem>.svg`` and ``<stem>.png`` are the picture, and
            ``<stem>.json`` keeps what goes with it.
        made_of: All that the picture depends on beside annelid's code, of plain numbers, words and lists.
        make: Draws the picture and returns what goes with it, ready for JSON.
    """
    mark = hashlib.sha256(json.dumps([code_fingerprint(), *made_of]).encode()).hexdigest()
    note = stem.with_name(f"{stem.name}.json")
    pictures = [stem.with_name(f"{stem.name}{suffix}") for suffix in (".svg", ".png")]
    try:
        content = read_json(note)
        if content["mark"] == mark and all(picture.exists() for picture in pictures):
            return content["found"]
    except (OSError, ValueError, KeyError, TypeError):
        pass
    note.unlink(missing_ok=True)
    found = make()
    with whole_file(note) as draft:
        draft.write_text(json.dumps({"mark": mark, "found": found}), encoding="utf-8")
    return found
