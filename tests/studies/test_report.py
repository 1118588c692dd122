from __future__ import annotations

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.draw.canvas import canvas, save_both
from annelid.errors import RunFileError
from annelid.markdown import anchors, cell, code, words
from annelid.text import printable
from annelid_studies.papers.report import claims_page, write_report
from annelid_studies.papers.report_parts import (
    Claim,
    Examination,
    Examined,
    Figure,
    Findings,
    Report,
    Table,
    Verdict,
)
from annelid_studies.riddle2023.paper import PAPER

COMMAND = """annelid run riddle2023 --set 'controller={kind = "program", ramp_s = 0.1}' --set arena.friction=0.3"""
SPECIAL = "1 * 2 * 3 _a_ b_c `code|bar` <b>bold</b> |x| < 3 & [4](http://x) #5 ~6~ $7$ \\8 &lt; !"
VERDICTS: list[Verdict] = ["holds", "holds within", "does not hold", "not testable here", "rests on"]


class Reading(HTMLParser):
    """What a page says and is made of; fails where a tag is not closed in its turn."""

    VOID = frozenset({"meta", "img", "br", "hr"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)
            self.texts.setdefault(tag, []).append("")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag in self.VOID
        self.handle_starttag(tag, attrs)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        for tag in set(self.open):
            self.texts[tag][-1] += data

    def has(self, text: str) -> bool:
        return " ".join(text.split()) in " ".join(self.texts["body"][0].split())

    def attributes(self, tag: str, name: str) -> list[str]:
        return [value for found, attrs in self.tags if found == tag and (value := attrs.get(name)) is not None]


def claim(number: int) -> Claim:
    topic = ["structure", "results", "structure", "future work"][number % 4]
    verdict = VERDICTS[number % 5]
    return Claim(
        topic,
        f"Claim {number} of the paper",
        f"Sect. {number}",
        paper=f"{number}.25 cm",
        ours=f"{number}.26 cm",
        evidence=f"Evidence {number}: {SPECIAL}",
        command="" if verdict == "not testable here" else f"{COMMAND} --set seed={number}",
        verdict=verdict,
        within={"holds within": "4.5 %", "rests on": "the run"}.get(verdict, ""),
    )


def examined(name: str) -> Examined:
    asked = Examination(name, f"On {name}", f"What of {name}?", lambda _: (), lambda *_: findings)
    table = Table([f"{name} | unit", "elongation, cm"], [[f"{name} a|b", "4.20"], [SPECIAL, "-1.5"]])
    findings = Findings(f"Much of {name}: {SPECIAL}", table, [f"Remark on {name}."])
    return Examined(asked, findings)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report's folder with two pictures."""
    folder = tmp_path_factory.mktemp("report")
    (folder / "figures").mkdir()
    for name in ("figure7", "pins of soft"):
        with canvas(1.0, 2.0) as figure:
            figure.subplots().plot([0, len(name)])
            save_both(figure, folder / "figures" / name)
    return folder


@pytest.fixture(scope="module")
def report(pictures: Path) -> Report:
    """A report on two pictures, ten claims and three examinations."""
    first, second = pictures / "figures" / "figure7.png", pictures / "figures" / "pins of soft.png"
    return Report(
        PAPER,
        "full",
        ["It walks: 1-2-3.", "2. And yet it moves.", SPECIAL],
        Table(["quantity", "paper", "ours", "deviation"], [["period, s", "2.635", "2.629", "−0.2 %"]]),
        Table(["quantity", "paper", "riddle2023"], [["force, N", "2.5", "2.283"]]),
        [
            Figure(5, "Muscle", second, f"Force above. {SPECIAL}"),
            Figure(7, "Potentials & lengths", first, f"Potentials above. {SPECIAL}"),
        ],
        [claim(number) for number in range(10)],
        [examined(name) for name in ("pins", "springs", "friction")],
        {"annelid": "0.3.0", "runs": "312"},
    )


@pytest.fixture(scope="module")
def html(report: Report, pictures: Path) -> Reading:
    return Reading(write_report(report, pictures).read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def rendered(html: Reading, pictures: Path) -> Reading:
    """The report's Markdown, read by a plain reader of GitHub's tables."""
    from markdown_it import MarkdownIt

    text = (pictures / "report.md").read_text(encoding="utf-8")
    return Reading(f"<body>{MarkdownIt('commonmark').enable('table').render(text)}</body>")


@pytest.fixture(params=["html", "rendered"])
def both(request: pytest.FixtureRequest) -> Reading:
    return request.getfixturevalue(request.param)


def test_both_files_hold_everything(both: Reading, report: Report) -> None:
    for each in report.claims:
        assert all(map(both.has, (each.claim, each.place, each.paper, each.ours, each.command)))
        assert both.has(each.evidence.replace("`", ""))
    for figure in report.figures:
        assert both.has(f"Figure {figure.number}. {figure.caption}".replace("`", ""))
    for one in report.examinations:
        asked, found = one.examination, one.findings
        assert all(map(both.has, (asked.title, asked.question, *found.remarks)))
        assert found.answer.replace("`", "") in both.texts["strong"]
        assert all(both.has(word.replace("`", "")) for row in found.table.rows for word in row)
    assert all(both.has(text.replace("`", "")) for text in report.summary)
    assert all(map(both.has, ("2.635", "−0.2 %", "2.283", "annelid 0.3.0", "runs 312")))


def test_pictures_are_embedded_and_have_captions(html: Reading, rendered: Reading, pictures: Path) -> None:
    prefix = "data:image/png;base64,"
    sources = html.attributes("img", "src")
    assert all(source.startswith(prefix) for source in sources)
    names = ["figure7.png", "pins of soft.png"]
    assert [base64.b64decode(source.removeprefix(prefix)) for source in sources] == [
        (pictures / "figures" / name).read_bytes() for name in names
    ]
    assert len(html.texts["figcaption"]) == len(html.texts["figure"]) == 2
    assert rendered.attributes("img", "src") == ["figures/figure7.png", "figures/pins%20of%20soft.png"]


def test_the_page_needs_nothing_else(html: Reading, pictures: Path) -> None:
    text = (pictures / "report.html").read_text(encoding="utf-8")
    bare = re.sub(r"data:image/png;base64,[A-Za-z0-9+/=]+", "", text)
    assert {tag for tag, _ in html.tags} & {"script", "link", "iframe", "object"} == set()
    assert all(link.startswith("#") for link in html.attributes("a", "href"))
    assert "url(" not in bare
    assert "@import" not in bare
    assert "default-src 'none'" in html.attributes("meta", "content")[-1] + html.attributes("meta", "content")[0]
    for name in ("report.html", "report.md"):
        assert str(pictures) not in (pictures / name).read_text(encoding="utf-8")


def test_links_of_the_page_have_their_target(html: Reading) -> None:
    targets = [name for tag in ("h2", "div") for name in html.attributes(tag, "id")]
    assert sorted(html.attributes("a", "href")) == sorted(f"#{name}" for name in targets)


def test_a_part_of_the_report_has_no_empty_headings(report: Report, tmp_path: Path) -> None:
    text = write_report(replace(report, figures=(), claims=(), examinations=()), tmp_path / "new").read_text("utf-8")
    assert Reading(text).texts["h2"] == ["Main numbers"]


def test_the_page_of_claims(report: Report) -> None:
    from markdown_it import MarkdownIt

    text = claims_page(report)
    page = Reading(f"<body>{MarkdownIt('commonmark').enable('table').render(text)}</body>")
    assert PAPER.command in page.texts["code"]
    for each in report.claims:
        assert all(map(page.has, (each.claim, each.paper, each.ours, each.command)))
        assert page.has(each.evidence.replace("`", ""))
    assert [len(row) for row in table_rows(text)] == [4] * 3 + [3] * 3 + [5] * 16
    assert page.has("10 claims:")
    assert "![" not in text


def table_rows(markdown: str) -> list[list[str]]:
    lines = [line for line in markdown.splitlines() if line.startswith("|")]
    return [re.split(r"(?<!\\)\|", line)[1:-1] for line in lines]


def test_a_folder_that_cannot_be_written_is_refused(report: Report, tmp_path: Path) -> None:
    (tmp_path / "report.md").mkdir()
    with pytest.raises(RunFileError, match=r"report\.md"):
        write_report(report, tmp_path)


def read_back(markdown: str, tag: str = "body") -> list[str]:
    """The words that a reader of GitHub's Markdown shows in the last such element."""
    from markdown_it import MarkdownIt

    reader = MarkdownIt("commonmark").enable(["table", "strikethrough"])
    return Reading(f"<body>{reader.render(markdown)}</body>").texts[tag][-1].split()


def in_table(markdown: str) -> str:
    return f"| head |\n| --- |\n| {cell(markdown)} |"


plain = st.text(st.sampled_from("ab1 *_[]()<>~$&;#!-+=.|\\:/'\"{}^%µ≈"), min_size=1).filter(str.strip)


@given(plain)
def test_any_text_reads_as_it_was_written(text: str) -> None:
    shown = [printable(word) for word in text.split()]
    assert read_back(words(text)) == shown
    assert read_back(in_table(words(text)), "td") == shown


@given(st.text(st.sampled_from("ab `|*<'\"\\"), min_size=1).filter(str.strip))
def test_any_command_reads_as_it_was_typed(text: str) -> None:
    assert read_back(code(text), "code") == text.split()
    assert read_back(in_table(code(text)), "code") == text.split()


def test_anchors_are_githubs() -> None:
    headings = ["Figure 5: force, length & velocity", "Friction from 0.05 to 1.5", "Pins", "pins", "PINS"]
    assert anchors(headings) == [
        "figure-5-force-length--velocity",
        "friction-from-005-to-15",
        "pins",
        "pins-1",
        "pins-2",
    ]
