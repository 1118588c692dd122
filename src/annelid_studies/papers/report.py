"""The report as Markdown and as one HTML file, and the page of claims for the repository."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from urllib.parse import quote

from annelid.draw import html_page
from annelid.markdown import anchors, code, emphasis, plain_table, strong, table, words
from annelid.output import write_text
from annelid_studies.papers.report_parts import Claim, Examined, Figure, Report, tally
from annelid_studies.papers.words import capitalised
from annelid_studies.tables import grouped

MARKDOWN_NAME, HTML_NAME = "report.md", "report.html"


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
    paper = report.paper
    intro = f"What {emphasis(paper.name)} ({paper.authors}) shows and claims, beside what annelid computes."
    head = f"# {paper.title}\n\n{intro}\n\n{_provenance(report)}"
    leading = [figure for figure in report.figures if figure.number in paper.leading]
    others = [figure for figure in report.figures if figure.number not in paper.leading]
    blocks = [
        *_main_numbers(report),
        *(block for figure in leading for block in _figure(figure, folder)),
        *_details_of_numbers(report),
        *_claims(report),
        *_more_figures(others, folder),
        *_examinations(report.examinations),
    ]
    contents, content = _contents(blocks), "\n\n".join(blocks)
    write_text(folder / MARKDOWN_NAME, f"{head}\n\n## Contents\n\n{contents}\n\n{content}\n")
    return write_text(folder / HTML_NAME, html_page(paper.title, head, contents, content, folder))


def claims_page(report: Report) -> str:
    """Returns the Markdown of the repository's page of claims, of a whole report."""
    paper = report.paper
    command = paper.command + (" --quick" if report.effort == "quick" else "")
    intro = (
        f"What the paper, {emphasis(paper.name)} ({paper.authors}), shows and claims, beside what annelid measures. "
        f"Every number of ours comes from a run; this page is written by {code(command)}, together with the "
        f"whole report{': its figures and its examinations' if report.examinations else ''}."
    )
    found = [f"- {strong(f'{one.examination.title}.')} {words(one.findings.answer)}" for one in report.examinations]
    answers = ["## What the examinations found", "\n".join(found)] if found else []
    numbers = [*_main_numbers(report), *_details_of_numbers(report)]
    return "\n\n".join([f"# {paper.heading}", intro, _provenance(report), *numbers, *_claims(report), *answers]) + "\n"


def _contents(blocks: Iterable[str]) -> str:
    parts = (block.partition(" ") for block in blocks)
    headings = [(len(marks), heading) for marks, _, heading in parts if set(marks) == {"#"}]
    links = anchors(heading.replace("\\", "") for _, heading in headings)
    rows = zip(headings, links, strict=True)
    return "\n".join(f"{'  ' * (level - 2)}- [{heading}](#{link})" for (level, heading), link in rows)


def _provenance(report: Report) -> str:
    effort = "Quick report, from fewer runs than the full one" if report.effort == "quick" else "Full report"
    return " · ".join([effort, *(f"{words(label)} {words(value)}" for label, value in report.provenance.items())])


def _paragraphs(texts: Iterable[str]) -> list[str]:
    return [words(text) for text in texts if text.strip()]


def _main_numbers(report: Report) -> list[str]:
    verdicts = f"Verdicts on the paper's {len(report.claims)} claims: {tally(report.claims)}." if report.claims else ""
    return [block for block in ("## Main numbers", plain_table(report.main_table), verdicts) if block]


def _details_of_numbers(report: Report) -> list[str]:
    numbers = ["### More numbers, several worms", plain_table(report.variants)]
    return ["### How to read the numbers", *_paragraphs(report.summary), *numbers]


def _claims(report: Report) -> list[str]:
    blocks = ["## Claims", "### How the claims are judged", *_paragraphs(report.rule)] if report.claims else []
    first = 1
    for topic, claims in grouped(report.claims, lambda claim: claim.topic).items():
        rows, notes = [], []
        for n, claim in enumerate(claims, first):
            verdict = strong(f"{claim.verdict} {claim.within}".strip())
            rows.append([str(n), words(claim.claim), verdict, words(claim.paper), words(claim.ours)])
            notes.append(f"{n}. {_note(claim, indent=' ' * (len(str(n)) + 2))}")
        heads = ["#", "Claim", "Verdict", "Paper", "Ours"]
        blocks += [f"### {words(capitalised(topic))}", table(heads, rows), "\n".join(notes)]
        first += len(claims)
    return blocks


def _note(claim: Claim, indent: str) -> str:
    place = f"{emphasis(claim.place)}:" if claim.place.strip() else ""
    said = " ".join(part for part in (place, words(claim.evidence)) if part)
    commands = [code(line) for line in claim.command.splitlines() if line.strip()]
    return f"\\\n{indent}".join([said, *commands] if said else commands)


def _more_figures(figures: Sequence[Figure], folder: Path) -> list[str]:
    blocks = ["## More figures of the paper"] if figures else []
    for figure in figures:
        blocks += [f"### Figure {figure.number}: {words(figure.title)}", *_figure(figure, folder)]
    return blocks


def _figure(figure: Figure, folder: Path) -> list[str]:
    caption = f"**Figure {figure.number}.** {words(figure.caption)}"
    return [_picture(figure.picture, figure.title, folder), caption]


def _examinations(examinations: Sequence[Examined]) -> list[str]:
    blocks = ["## Examinations"] if examinations else []
    for examined in examinations:
        asked, found = examined.examination, examined.findings
        answer = [strong(found.answer), plain_table(found.table)]
        blocks += [f"### {words(capitalised(asked.title))}", words(asked.question), *answer]
        blocks += _paragraphs(found.remarks)
    return [block for block in blocks if block]


def _picture(picture: Path, title: str, folder: Path) -> str:
    relative = Path(os.path.relpath(picture, folder)).as_posix()
    return f"![{words(title)}]({quote(relative)})"
