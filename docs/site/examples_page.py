"""The page of examples, made from the examples' own first lines and code."""

from __future__ import annotations

import ast
from pathlib import Path


def page(folder: Path) -> str:
    """Returns the page below its introduction: what every example is for, then each with its code.

    Args:
        folder: Where the examples are.
    """
    examples = {path.stem: path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.py"))}
    purposes = {name: (ast.get_docstring(ast.parse(code)) or "").splitlines()[0] for name, code in examples.items()}
    lines = [
        "| example | what it is for |",
        "|---|---|",
        *(f"| [{name}](#{name}) | {purpose} |" for name, purpose in purposes.items()),
    ]
    for name, code in examples.items():
        lines += ["", f"## {name} {{ #{name} }}", "", f'```python title="examples/{name}.py"', code.rstrip(), "```"]
    return "\n".join(lines) + "\n"
