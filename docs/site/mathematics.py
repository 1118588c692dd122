r"""Formulas of pages, ``$..$`` and ``$$..\tag{n}$$`` in LaTeX as GitHub shows them, as MathML for browsers offline.

An extension of Python-Markdown, which the site's generator finds by the name of this module.
"""

from __future__ import annotations

import re

from latex2mathml.converter import convert
from markdown import Markdown
from markdown.extensions import Extension
from markdown.inlinepatterns import InlineProcessor

FORMULA = r"\$\$\s*(?P<display>[^$]+?)\s*\$\$|\$(?P<inline>[^$\s](?:[^$]*[^$\s])?)\$"
TAG = re.compile(r"\s*\\tag\{(\d+)\}")
BEHIND_CODE = 185
"""Priority: code spans are found before formulas, and escapes and emphasis behind them."""


class Formula(InlineProcessor):
    """Puts a formula's MathML in its place, beside its number if it has one."""

    def handleMatch(self, m: re.Match[str], data: str) -> tuple[str, int, int]:
        """Returns what stands for the formula, and where it ends."""
        if m["inline"]:
            html = mathml(m["inline"], "inline")
        else:
            number = TAG.search(m["display"])
            html = f'<span class="formula" tabindex="0">{mathml(TAG.sub("", m["display"]), "block")}</span>'
            if number:
                html = f'<span class="equation" id="equation-{number[1]}">{html}<span>({number[1]})</span></span>'
        return self.md.htmlStash.store(html), m.start(0), m.end(0)


class Mathematics(Extension):
    """Adds formulas to what a page may have."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Registers the pattern of formulas."""
        md.inlinePatterns.register(Formula(FORMULA, md), "formula", BEHIND_CODE)


def mathml(latex: str, display: str) -> str:
    """Returns a formula as MathML.

    Args:
        latex: The formula.
        display: ``"block"`` or ``"inline"``.

    Raises:
        ValueError: The converter knows a command no better than to show it as it is.
    """
    html = convert(latex, display=display)
    if "\\" in html or "&</" in html:
        raise ValueError(f"cannot be written as MathML: {latex}")
    html = re.sub(r"<mo>(&#x02016;|&#x0007C;)</mo>", r'<mo stretchy="false">\1</mo>', html)
    return re.sub('<mi mathvariant="bold">([A-Za-z])</mi>', lambda letter: f"<mi>{bold(letter[1])}</mi>", html)


def bold(letter: str) -> str:
    """Returns the bold form of a Latin letter, since some browsers ignore that it should be bold."""
    return chr((0x1D400 - ord("A") if letter.isupper() else 0x1D41A - ord("a")) + ord(letter))


def makeExtension(**settings: object) -> Mathematics:
    """Makes the extension, as Python-Markdown asks for it."""
    return Mathematics(**settings)
