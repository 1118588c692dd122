"""The report as Markdown and as one HTML file, and the page of claims for the repository."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from urllib.parse import quote

from annelid.draw import html_page
from annelid.markdown import anchors, code, emphasis, plain_table, strong, table, words
from annelid.output import whole_file
from annelid_studies.riddle2023.contents import Claim, Examined, Figure, Report, tally

TITLE = "The paper, reproduced and examined"
PAPER = "A Dynamic Simulation of a Compliant Worm Robot Amenable to Neural Control"
MARKDOWN_NAME, HTML_NAME = "report.md", "report.html"
CLAIMS_COMMAND = "annelid paper -o report --claims docs/paper.md"
"""The command that regenerates the page of claims in the repository."""


def write_report(report: Report, folder: Path) -> Path:
    """Writes ``report.md``, which refers to its pictures, and ``report.html``, which holds them.

    Args:
        report: What to write.
        folder: Where to write it; made where missing.

    Returns:
        Path of the HTML file.

    Raises:
        RunFileError: A file cannot be written.
        OSError: The folder cannot be made, or a picture cannot be read.
    """
    folder.mkdir(parents=True, exist_ok=True)
    head, sections = _head(report), _sections(report, folder)
    contents, content = _contents(sections), "\n\n".join(sections)
    _write(folder / MARKDOWN_NAME, f"{head}\n\n## Contents\n\n{contents}\n\n{content}\n")
    _write(folder / HTML_NAME, html_page(TITLE, head, contents, content, folder))
    return folder / HTML_NAME


def claims_page(report: Report) -> str:
    """Returns the Markdown of the repository's page of claims.

    Args:
        report: A whole report.
    """
    intro = (
        f"What the paper, {emphasis(PAPER)} (Riddle et al. 2023), shows and claims, beside what annelid measures. "
        f"Every number of ours comes from a run; this page is written by {code(CLAIMS_COMMAND)}, together with the "
        f"whole report: its figures and its examinations."
    )
    blocks = ["# The paper's claims", intro, *_paragraphs(report.summary), *_headlines(report.examinations)]
    blocks += [_provenance(report), *_main_numbers(report)]
    return "\n\n".join([*blocks, *_claims(report.claims, report.rule)]) + "\n"


def _write(path: Path, text: str) -> None:
    with whole_file(path) as draft:
        draft.write_text(text, encoding="utf-8")


def _head(report: Report) -> str:
    intro = f"Every figure and claim of {emphasis(PAPER)} (Riddle et al. 2023) from our own runs."
    return "\n\n".join([f"# {TITLE}", f"{intro} {_provenance(report)}"])


def _sections(report: Report, folder: Path) -> list[str]:
    """Returns the blocks of the report below its head, each a heading or what follows one."""
    return [
        "## Summary",
        *_paragraphs(report.summary),
        *_headlines(report.examinations),
        *_main_numbers(report),
        *_claims(report.claims, report.rule),
        *_figures(report.figures, folder),
        *_examinations(report.examinations, folder),
        *_how_to_reproduce(report),
    ]


def _contents(blocks: Iterable[str]) -> str:
    headings = [
        (len(marks), heading) for marks, _, heading in (block.partition(" ") for block in blocks) if set(marks) == {"#"}
    ]
    links = anchors(heading.replace("\\", "") for _, heading in headings)
    rows = zip(headings, links, strict=True)
    return "\n".join(f"{'  ' * (level - 2)}- [{heading}](#{link})" for (level, heading), link in rows)


def _provenance(report: Report) -> str:
    effort = "Quick report, with coarser maps than the full one" if report.effort == "quick" else "Full report"
    facts = [effort, *(f"{words(label)} {words(value)}" for label, value in report.provenance.items())]
    return " · ".join(facts)


def _paragraphs(texts: Iterable[str]) -> list[str]:
    return [words(text) for text in texts if text.strip()]


def _headlines(examinations: Sequence[Examined]) -> list[str]:
    """A list of what each examination found."""
    if not examinations:
        return []
    lines = [f"- {strong(each.examination.title + '.')} {words(each.findings.answer)}" for each in examinations]
    return ["What the examinations found:", "\n".join(lines)]


def _main_numbers(report: Report) -> list[str]:
    return ["## Main numbers", plain_table(report.main_table)]


def _claims(claims: Sequence[Claim], rule: Sequence[str]) -> list[str]:
    if not claims:
        return []
    blocks = ["## Claims", f"{len(claims)} claims. {tally(claims)}.", *_paragraphs(rule)]
    topics = dict.fromkeys(claim.topic for claim in claims)
    first = 1
    for topic in topics:
        numbered = list(enumerate((claim for claim in claims if claim.topic == topic), first))
        rows = [
            [str(n), words(claim.claim), strong(_verdict(claim)), words(claim.paper), words(claim.ours)]
            for n, claim in numbered
        ]
        notes = [f"{n}. {_note(claim, indent=' ' * (len(str(n)) + 2))}" for n, claim in numbered]
        blocks += [f"### {_heading(topic)}", table(["#", "Claim", "Verdict", "Paper", "Ours"], rows), "\n".join(notes)]
        first += len(numbered)
    return blocks


def _verdict(claim: Claim) -> str:
    return f"{claim.verdict} {claim.within}".strip()


def _note(claim: Claim, indent: str) -> str:
    place = f"{emphasis(claim.place)}:" if claim.place.strip() else ""
    said = " ".join(part for part in (place, words(claim.evidence)) if part)
    commands = [code(line) for line in claim.command.splitlines() if line.strip()]
    return f"\\\n{indent}".join([said, *commands] if said else commands)


def _heading(text: str) -> str:
    return words(text[:1].upper() + text[1:])


def _figures(figures: Sequence[Figure], folder: Path) -> list[str]:
    if not figures:
        return []
    blocks = ["## Figures of the paper"]
    for figure in figures:
        name = f"Figure {figure.number}"
        caption = f"**{name}.** {words(figure.caption)}"
        blocks += [f"### {name}: {words(figure.title)}", _picture(figure.picture, figure.title, folder), caption]
    return blocks


def _examinations(examinations: Sequence[Examined], folder: Path) -> list[str]:
    if not examinations:
        return []
    blocks = ["## Examinations"]
    for examined in examinations:
        asked, found = examined.examination, examined.findings
        picture = _picture(examined.picture, asked.title, folder)
        answer = [strong(found.answer), picture, emphasis(found.caption), plain_table(found.table)]
        blocks += [f"### {_heading(asked.title)}", words(asked.question), *answer, *_paragraphs(found.remarks)]
    return [block for block in blocks if block]


def _picture(picture: Path, title: str, folder: Path) -> str:
    relative = Path(os.path.relpath(picture, folder)).as_posix()
    return f"![{words(title)}]({quote(relative)})"


def _how_to_reproduce(report: Report) -> list[str]:
    whole = f"annelid paper -o report{' --quick' if report.effort == 'quick' else ''}"
    parts = [(each.examination.title, f"{whole} --only {each.examination.name}") for each in report.examinations]
    here = whole if report.claims else " ".join([whole, *(part.removeprefix(f"{whole} ") for _, part in parts)])
    commands = [("this report", here), *parts, ("the page of claims in the repository", CLAIMS_COMMAND)]
    told = (
        "Each claim names the command that makes its number; `annelid show RUN` then prints it. Every run of this "
        "report is kept in `runs`, every figure as PNG and SVG in `figures`. A second call computes only what is "
        "missing or has changed."
    )
    versions = table(["What", "Value"], [[words(name), words(value)] for name, value in report.provenance.items()])
    rows = [[words(what), code(command)] for what, command in commands]
    return ["## How to reproduce", told, table(["To make", "Command"], rows), versions]
