"""Tables of numbers are filled from result files: page and files agree, and no such table stands without a file."""

from __future__ import annotations

import csv
import json
import re
import shlex
import tomllib
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import pytest
from doc_commands import PAGES, ROOT, Command, commands_of
from test_doc_commands import check_annelid, check_program

import measure_runs
from fill_tables import DOCS, MARKED, WORMS, FillError, filled, made_by, main, measured, missing_files, tables_of, worm

MOST = 5
"""Cells with a number that a table may have and not be one of results."""
NUMBER = re.compile(r"^\W*\d[\d.,]*(?![\d-])")

WAITING: tuple[str, ...] = ()
"""Result files that do not exist yet: their tables have the numbers of earlier runs."""

EXCEPTIONS = {
    ("docs/environments.md", "numbers"): "spaces of the environment, not results: tests/environments compares them",
    ("docs/explanation/equations.md", "symbol"): "values of presets, which test_equations compares",
    ("docs/explanation/equations.md", "conductance"): "the same",
    ("docs/explanation/equations.md", "equation"): "numbers of equations",
    ("docs/evidence/gait.md", "number"): "definitions, not results",
    ("docs/how_to/install.md", "extra"): "sizes of other packages",
    ("docs/evidence/material.md", "source"): "published values",
    ("docs/evidence/paper.md", "quantity"): "`annelid study paper --claims FILE.md` writes the whole page",
    ("docs/evidence/paper.md", "#"): "the same",
    (
        "docs/evidence/riddle2025.md",
        "ground",
    ): "`annelid study paper riddle2025 --claims FILE.md` writes the whole page",
    ("docs/evidence/riddle2025.md", "quantity"): "the same",
    ("docs/evidence/riddle2025.md", "#"): "the same",
    ("docs/troubleshooting.md", "code"): "exit codes, not results",
    ("docs/evidence/presets.md", "field"): "fields of a preset, which tests/test_presets.py compares with its sources",
    ("docs/evidence/validation.md", "formulation"): "printed by `pytest -m slow -s tests/body/test_ring_down.py`",
    ("docs/evidence/validation.md", "step (ms)"): "the same",
    ("docs/wire.md", "bytes"): "the protocol, not results",
    ("docs/evidence/worm_robots.md", "robot"): "published values",
    ("docs/evidence/weak_middle.md", "cause"): "printed by `annelid study weak-middle`, which writes it into no file",
}
"""Tables of numbers without a result file, by page and first head, and why."""

NO_WORM = {
    "bench.json": "every case names the digest of its own configuration",
    "loop.csv": "times of a loop with a pseudo-robot",
    "robust_network.csv": "networks without a body",
    "firmware_random.csv": "the same",
    "peers.csv": "a strand and a net without a worm",
    "rod_bench.csv": "single rods",
    "calibration_default.json": "a fit with a body of its own",
    "identify_recovery.csv": "synthetic robots",
    "identify_recovery_table.csv": "the same",
    "identify_walks.csv": "the same",
    "identify_walks_table.csv": "the same",
    "material.csv": "the swept materials are its rows",
}
"""Result files that are not of presets, and why."""

LISTS = sorted(path for path in (DOCS / "results").glob("*.toml") if "[runs]" in path.read_text(encoding="utf-8"))
ARTICLE_AND_PAGES = PAGES | {"paper/paper.md": (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")}
TABLES = [table for page in ARTICLE_AND_PAGES.values() for table in tables_of(page)]
PAGE = """# Gaits

<!-- table: page/gaits -->

<!-- end of table -->
"""
TABLE = """
[gaits]
results = ["gaits.csv", "bench.json:levels"]
head = "| gait | of friction | speed | elongation |"
rows = "| `fast`, ordered: {fast.ordered} | | {fast.speed_m / slow_one.speed_m:.1f} times | published: 4 / 5 cm |"
condition = 'run != "fast"'
each = "| {run} | {arena_friction} | {100 * speed_m:.1f} cm/s | {100 * (e_m / slow_one.e_m):.0f} % |"
"""
FILLED = """
| gait | of friction | speed | elongation |
|---|---|---|---|
| `fast`, ordered: yes | | 2.5 times | published: 4 / 5 cm |
| slow one | 0.3 | 2.0 cm/s | 100 / 100 % |
| none | – | – cm/s | – / – % |
"""


@pytest.fixture
def docs(tmp_path: Path) -> Path:
    """A folder of pages with results."""
    tmp_path = tmp_path / "docs"
    (tmp_path / "results" / "tables").mkdir(parents=True)
    (tmp_path / "results" / "tables" / "page.toml").write_text(TABLE)
    rows = "run,arena.friction,speed_m,e_m_1,e_m_2\nslow one,0.3,0.02,0.04,0.05\nnone,,,nan,\n"
    (tmp_path / "results" / "gaits.csv").write_text(rows)
    levels = {"levels": [{"run": "fast", "speed_m": 0.05, "ordered": True}], "machine": "none"}
    (tmp_path / "results" / "bench.json").write_text(json.dumps(levels))
    return tmp_path


def unfilled(page: str) -> Iterator[str]:
    """First head of every table that has numbers and stands between no markers."""
    for is_table, lines in groupby(MARKED.sub("", page).splitlines(), lambda line: line.lstrip().startswith("|")):
        if is_table:
            head, *rows = (re.sub(r"`[^`]*`|\\\|", "", line).strip().strip("|").split("|") for line in lines)
            if sum(bool(NUMBER.match(cell.strip())) for row in rows for cell in row) > MOST:
                yield head[0].strip()


def test_pages_have_the_numbers_of_their_files() -> None:
    assert [name for name, page in PAGES.items() if filled(page) != page] == [], "run: python docs/site/fill_tables.py"


def test_every_table_is_shown_and_only_these_files_are_waited_for() -> None:
    named = {"/".join(found) for page in ARTICLE_AND_PAGES.values() for found in MARKED.findall(page)}
    files = (DOCS / "results" / "tables").glob("*.toml")
    assert named == {f"{path.stem}/{name}" for path in files for name in tomllib.loads(path.read_text("utf-8"))}
    assert {file for table in TABLES for file in missing_files(table, DOCS)} == set(WAITING)


def test_every_table_of_numbers_has_its_file() -> None:
    assert {(name, head) for name, page in PAGES.items() for head in unfilled(page)} == set(EXCEPTIONS)


def test_every_result_file_is_shown() -> None:
    named = {file.partition(":")[0] for table in TABLES for file in table.results}
    assert set(made_by()) == named
    there = {path.name for path in (DOCS / "results").glob("*.*") if path.suffix != ".toml"}
    assert {
        file
        for file in there - named
        if not any(re.search(rf"\]\((?:\.\./)?results/{file}\)", page) for page in PAGES.values())
    } == set()


def test_numbers_are_of_worms_as_they_are() -> None:
    known = tomllib.loads((DOCS / WORMS).read_text(encoding="utf-8"))
    there = {path.name for path in (DOCS / "results").glob("*.*") if path.suffix != ".toml"}
    assert set(known) == there - set(NO_WORM), "run: python docs/site/fill_tables.py --measured FILE PRESET.."
    changed = {file for file, worms in known.items() if any(worm(preset) != digest for preset, digest in worms.items())}
    assert changed == set(), "measure these again"


def test_a_result_file_is_noted_with_its_worms(docs: Path) -> None:
    (docs / WORMS).write_text('# which worms\n"old.csv" = { crawler = "1" }\n')
    measured("gaits.csv", ["crawler", "riddle2022-planar"], docs)
    noted = (docs / WORMS).read_text()
    assert noted.startswith("# which worms")
    known = tomllib.loads(noted)["gaits.csv"]
    assert known == {"crawler": worm("crawler"), "riddle2022-planar": worm("riddle2022-planar")}
    assert len(set(known.values())) == 2
    with pytest.raises(FillError, match=r"missing.csv"):
        measured("missing.csv", ["crawler"], docs)


def test_evidence_says_the_commands_of_its_tables() -> None:
    missing = []
    for name in PAGES:
        said = commands_of(name) if name.startswith("docs/evidence/") else None
        files = {file.partition(":")[0] for table in tables_of(PAGES[name]) for file in table.results}
        lines = {one for file in files for one in made_by()[file].split("; ")}
        missing += [
            (name, line) for line in lines if said is not None and Command(tuple(shlex.split(line))) not in said
        ]
    assert missing == []


def test_commands_that_make_results_are_understood() -> None:
    commands = {one for command in made_by().values() for one in command.split("; ")}
    lists = {one for path in LISTS for one in tomllib.loads(path.read_text(encoding="utf-8"))["runs"].values()}
    assert lists
    for line in commands | lists:
        words = tuple(shlex.split(line))
        (check_annelid if words[0] == "annelid" else check_program)(Command(words))
        assert all((ROOT / word).exists() for word in words if word.endswith(".toml")), line


def test_numbers_are_filled_in(docs: Path) -> None:
    page = filled(PAGE, docs)
    assert page == PAGE.replace("-->\n\n<!--", f"-->\n{FILLED}\n<!--")
    assert filled(page, docs) == page


def test_a_row_may_use_another_one_s_numbers(docs: Path) -> None:
    row = '| {run} | {other(run + " one").speed_m:.2f} | {other("nobody").speed_m:+.1f} |'
    table = TABLE[: TABLE.index("rows")] + f"condition = 'run in (\"fast\", \"none\")'\neach = '''{row}'''\n"
    (docs / "results" / "tables" / "page.toml").write_text(table)
    rows = docs / "results" / "gaits.csv"
    rows.write_text(rows.read_text() + "none one,,0.04,nan,\n")
    assert filled(PAGE, docs).endswith("| none | 0.04 | – |\n| fast | – | – |\n\n<!-- end of table -->\n")


def test_a_changed_file_is_found(docs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page, root = docs / "page.md", docs.parent
    page.write_text(PAGE)
    (root / "README.md").touch()
    assert (main(True, root), main(False, root), main(True, root)) == (1, 0, 0)
    results = docs / "results" / "gaits.csv"
    results.write_text(results.read_text().replace("0.02", "0.03"))
    assert main(True, root) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "docs/page.md: differs from its result files"
    assert "2.0 cm/s" in page.read_text()


def test_a_table_waits_for_its_file(docs: Path) -> None:
    page = filled(PAGE, docs)
    (docs / "results" / "gaits.csv").unlink()
    assert filled(page, docs) == page
    assert missing_files(tables_of(page, docs)[0], docs) == ["gaits.csv"]


def test_a_wrong_table_is_refused(docs: Path) -> None:
    for right, wrong in (
        ("{run}", "{name}"),
        ("slow_one.", "slower_one."),
        ('["gaits.csv"', '["../gaits.csv"'),
        ('["gaits.csv"', '["/etc/gaits.csv"'),
        ("head =", "heads ="),
        ("[gaits]", "[speeds]"),
    ):
        (docs / "results" / "tables" / "page.toml").write_text(TABLE.replace(right, wrong))
        with pytest.raises(FillError):
            filled(PAGE, docs)
    with pytest.raises(FillError, match="end"):
        filled(PAGE.replace("<!-- end of table -->", "<!-- end -->"), docs)


@pytest.mark.slow
def test_a_list_of_runs_is_measured(tmp_path: Path) -> None:
    path = tmp_path / "planar.toml"
    path.write_text(
        '[runs]\nlong = "annelid run riddle2022-planar --duration 3"\n'
        'short = "annelid run riddle2022-planar --duration 0.1"\n'
    )
    measure_runs.main(path)
    with path.with_suffix(".csv").open(encoding="utf-8") as file:
        long, short = csv.DictReader(file)
    assert (long["run"], long["command"]) == ("long", "annelid run riddle2022-planar --duration 3")
    assert float(long["period_s"]) == pytest.approx(2.625, abs=0.02)
    assert long["order"].startswith("1-2-3")
    assert float(long["elongation_mean_max_m_3"]) > 0
    assert short["period_s"] == short["speed_m_per_s"] == ""
    assert "real_time_factor" not in long
