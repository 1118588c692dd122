"""Tutorials are notebooks in Markdown: they are run, and what they print and draw is shown below the code."""

from __future__ import annotations

import base64
import hashlib
import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import jupytext
import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).parent.parent.parent
CACHE_VARIABLE = "ANNELID_DOCS_CACHE"
TIMEOUT_S = 300
CODES_OF_COLOURS = re.compile(r"\x1b\[[0-9;]*m")


@dataclass
class Shown:
    """A tutorial as the site shows it.

    Attributes:
        markdown: The page.
        files: Pictures and the notebook, by names relative to the page's folder.
    """

    markdown: str
    files: dict[str, bytes] = field(default_factory=dict)


def run(text: str, name: str) -> Shown:
    """Runs a tutorial and puts its outputs into the page.

    What has been run before, with the same text and the same package, is taken from the cache: the folder that
    ``ANNELID_DOCS_CACHE`` names, or ``build/tutorials``.

    Args:
        text: The notebook in Jupytext's Markdown.
        name: Its name, for the files that belong to it.

    Raises:
        nbclient.exceptions.CellExecutionError: A cell failed; the message shows it.
    """
    folder = Path(os.environ.get(CACHE_VARIABLE, ROOT / "build" / "tutorials"))
    kept = folder / f"{name}-{_digest(text)}.ipynb"
    if kept.exists():
        notebook = nbformat.reads(kept.read_text(encoding="utf-8"), as_version=4)
    else:
        notebook = executed(text)
        folder.mkdir(parents=True, exist_ok=True)
        draft = kept.with_suffix(f".{os.getpid()}")
        draft.write_text(nbformat.writes(notebook), encoding="utf-8")
        draft.replace(kept)
    return show(notebook, text, name)


def executed(text: str) -> Any:
    """Runs a notebook from top to bottom in an empty folder, and returns it with its outputs."""
    notebook = jupytext.reads(text, fmt="md")
    with TemporaryDirectory() as folder:
        client = NotebookClient(
            notebook, timeout=TIMEOUT_S, kernel_name="python3", resources={"metadata": {"path": folder}}
        )
        return client.execute()


def show(notebook: Any, text: str, name: str) -> Shown:
    """Writes a notebook that was run as a page."""
    shown = Shown("", {f"{name}.ipynb": nbformat.writes(jupytext.reads(text, fmt="md")).encode()})
    parts: list[str] = []
    for cell in notebook.cells:
        if cell.cell_type != "code":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        parts += [part for output in cell.outputs for part in _shown(output, name, shown.files)]
    title, rest = parts[0].split("\n", 1) if "\n" in parts[0] else (parts[0], "")
    note = f"*Run as it stands: type it, or [open the notebook]({name}.ipynb) in Jupyter.*"
    shown.markdown = "\n\n".join([title, note, rest.strip(), *parts[1:]]) + "\n"
    return shown


def _shown(output: Any, name: str, files: dict[str, bytes]) -> list[str]:
    """One output: a picture, or text; progress on stderr is left out."""
    if output.output_type == "stream":
        return [_text(output.text)] if output.name == "stdout" else []
    data = output.get("data", {})
    if "image/png" in data:
        picture = f"{name}_{sum(each.endswith('.png') for each in files) + 1}.png"
        files[picture] = base64.b64decode(data["image/png"])
        return [f"![What the code above draws]({picture})"]
    return [_text(data["text/plain"])] if "text/plain" in data else []


def _text(text: str) -> str:
    lines = "\n".join(line.rstrip() for line in CODES_OF_COLOURS.sub("", text).strip("\n").splitlines())
    return f"```text {{ .output }}\n{lines}\n```"


def _digest(text: str) -> str:
    digest = hashlib.sha256(text.encode())
    sources = ROOT / "src" / "annelid"
    for path in sorted(path for path in sources.rglob("*") if path.suffix in (".py", ".toml", ".csv")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
