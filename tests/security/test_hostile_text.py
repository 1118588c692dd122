"""Names and messages from strangers: whatever they contain, it is shown as text, or refused in a sentence."""

from __future__ import annotations

import csv
import io
import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from rich.table import Table
from typer.testing import CliRunner

from annelid.cli import app
from annelid.config import load_config
from annelid.draw.figures.network_diagram import network_figure, network_svg
from annelid.draw.figures.sweep import sweep_figure
from annelid.errors import AnnelidError, ConfigError
from annelid.nervous import Network, Neuron
from annelid.output import write_csv
from annelid.simulation.runfile import Run, open_run
from annelid.terminal import Console
from annelid.text import printable

NAME = "[/bold]$$ $x^{ </title><script>alert(1)</script> &amp; ]]> -- |a| `b` ![](http://a.example/x) {0}%s =1+1 '\""
"""Markup of rich, of formulas, HTML, XML, Markdown and of Python's templates."""
COMMANDS = (
    "\x1b[2J",
    "\x1b]52;c;cm0gLXJmIH4=\x07",
    "\x9b31m",
    "\x07",
    "a\rb",
    "\u202egnp.exe",
    "\u2066x",
    "\x00",
    "\x7f",
)
"""Clear the screen, write the clipboard, a C1 control, the bell, back to the start, other directions, NUL, DEL."""
HOSTILE = "".join(COMMANDS) + NAME
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def annelid(*words: str | Path, code: int = 0) -> str:
    """What a command prints, on both streams; nothing of it commands a terminal."""
    result = CliRunner().invoke(app, [str(word) for word in words], prog_name="annelid")
    assert result.exit_code == code, result.output
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert CONTROL.search(result.output) is None, repr(result.output)
    return result.output


class Tags(HTMLParser):
    """Collects what a page would run or load."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))


def require_plain_page(page: str) -> None:
    assert CONTROL.search(page) is None
    for tag, attributes in Tags(page).found:
        assert tag not in {"script", "iframe", "object", "link"}
        assert not any(name.startswith("on") for name in attributes)
        assert str(attributes.get("src", "data:")).startswith("data:")
        assert str(attributes.get("href", "#")).startswith(("#", "https://doi.org/"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run under a name of markup."""
    folder = tmp_path_factory.mktemp("markup") / "run"
    words = ["riddle2022-planar", "--duration", "1", "--no-video", "--out", str(folder)]
    assert NAME.split("{")[0][:7] in annelid("run", *words, "--set", f"name={json.dumps(NAME)}")
    return folder


@pytest.fixture
def hostile(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """The same run, as if a stranger had written every text that its file holds but the configuration."""
    run = open_run(folder)
    data = run.data.assign_attrs({key: HOSTILE for key, value in run.data.attrs.items() if isinstance(value, str)})
    for name in data.variables:
        data[name].attrs = dict.fromkeys(data[name].attrs, HOSTILE)
    data = data.assign_coords(neuron=[f"=cmd|{i}{HOSTILE}" for i in range(data.sizes["neuron"])])
    changed = replace(run.with_data(data), message=HOSTILE)
    monkeypatch.setattr("annelid.simulation.runfile.open_run", lambda _: changed)
    return changed


def test_a_name_is_one_line_of_printable_text(tmp_path: Path) -> None:
    for text in ("\x1b[2J", "\u202egnp.exe", "\x00", "two\nlines", "a\ttab", "x" * 201):
        said = annelid(
            "run", "riddle2022-planar", "--out", tmp_path / "run", "--set", f"name={json.dumps(text)}", code=2
        )
        assert "name" in said
    with pytest.raises(ConfigError, match="summary"):
        load_config("riddle2022-planar", {"summary": "\x1b[2J"})
    assert not (tmp_path / "run").exists()
    assert load_config("riddle2022-planar", {"name": "Regenwurm \U0001fab1 \u5c3a\u8816 \u00a7"}).name


def test_a_name_of_markup_is_shown_as_it_is(folder: Path, tmp_path: Path) -> None:
    assert NAME.split()[0] in annelid("show", folder)
    assert json.loads(annelid("show", folder, "--json"))["name"] == NAME
    annelid("draw", folder, "-o", tmp_path / "figure7.svg")
    assert "$$" in (tmp_path / "figure7.svg").read_text()
    ET.parse(tmp_path / "figure7.svg")
    annelid("cite", folder)
    annelid("export", folder, "--to", "html", "-q", "-o", tmp_path / "page.html")
    require_plain_page((tmp_path / "page.html").read_text())
    annelid(
        "export", "riddle2023-rods", "--to", "mjcf", "--set", f"name={json.dumps(NAME)}", "-o", tmp_path / "worm.xml"
    )
    assert ET.parse(tmp_path / "worm.xml").getroot().get("model") == NAME


def test_runs_in_folders_of_any_name_are_compared(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / f"_{NAME.replace('/', '')}\x1b[2J"
    other.mkdir()
    (other / "run.nc").write_bytes((folder / "run.nc").read_bytes())
    annelid("compare", folder, other, "-o", tmp_path / "out")
    assert (tmp_path / "out" / "lengths.png").stat().st_size > 5000
    annelid("compare", folder, other, "--json")
    annelid("show", other / "run.nc" / "nothing", code=2)


def test_a_strangers_run_is_shown_and_exported_as_text(hostile: Run, tmp_path: Path) -> None:
    assert "\\u202egnp.exe" in annelid("show", hostile.path)
    json.loads(annelid("show", hostile.path, "--json"))
    annelid("draw", hostile.path, "-o", tmp_path / "figure7.png")
    annelid("export", hostile.path, "--to", "csv", "-q", "-o", tmp_path / "csv")
    for table in (tmp_path / "csv").glob("*.csv"):
        text = table.read_text()
        assert CONTROL.search(text) is None
        assert not any(cell.startswith(("=", "@")) for row in csv.reader(io.StringIO(text)) for cell in row)
    json.loads((tmp_path / "csv" / "about.json").read_text())
    annelid("export", hostile.path, "--to", "html", "-q", "-o", tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    require_plain_page(page)
    assert "\\u001b[2J" in page


def test_an_error_names_what_is_wrong_as_text() -> None:
    hostile = HOSTILE.replace("\x00", "")
    for words in (["show", hostile], [hostile], ["run", f"--{hostile}"], ["run", "--set", f"{hostile}=1"]):
        assert annelid(*words, code=2)


def test_errors_and_warnings_of_the_library_are_text() -> None:
    assert CONTROL.search(str(AnnelidError(HOSTILE))) is None
    script = """
import sys, warnings
from annelid.cli.entry import app, main
def die():
    warnings.warn("\\x9b\\u202e")
    print("\\x1b[2J\\u202e")
    raise ValueError("\\x1b[2J\\x9b")
app.command("die")(die)
sys.argv = ["annelid", "die"]
main()
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=False, encoding="utf-8", timeout=120)
    assert "ValueError: \\u001b[2J\\u009b\n" in done.stderr
    assert "annelid: warning: \\u009b\\u202e\n" in done.stderr
    assert done.stdout == "\\u001b[2J\\u202e\n"
    assert CONTROL.search(done.stderr) is None


def test_the_console_takes_neither_markup_nor_commands() -> None:
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, width=200, color_system=None)
    table = Table(HOSTILE, title=HOSTILE, caption=HOSTILE)
    table.add_row(HOSTILE)
    console.print(table)
    console.print(HOSTILE)
    assert CONTROL.search(file.getvalue()) is None
    assert file.getvalue().count("[/bold]") == 5


def test_tables_hold_no_formulas(tmp_path: Path) -> None:
    cells = ["=cmd|' /C calc'!A0", "@SUM(1)", "+1+1", "-2+3", "-1.5", "+2e3", "-", -1.5, None, "\x1b[2J"]
    path = write_csv(tmp_path / "table.csv", ["=A1", "b"], [[cell, 1] for cell in cells])
    rows = list(csv.reader(path.open(newline="")))
    assert rows[0] == ["'=A1", "b"]
    kept = ["-1.5", "+2e3", "-", "-1.5", "", "\\u001b[2J"]
    assert [row[0] for row in rows[1:]] == ["'=cmd|' /C calc'!A0", "'@SUM(1)", "'+1+1", "'-2+3", *kept]


def test_a_sweep_over_names_is_drawn(tmp_path: Path) -> None:
    names = np.array(["$$", "$x^{", "[/bold]"])
    coords = {"name": ("name", names, {"units": "1"}), "other": ("other", names, {"units": "1"})}
    data = xr.Dataset({"speed_m_per_s": (("name", "other"), np.eye(3), {"heading": "speed (m/s)"})}, coords)
    for fields in (["name"], ["name", "other"]):
        sweep_figure(data, fields, ["speed_m_per_s"], tmp_path / "sweep")
        ET.parse(tmp_path / "sweep.svg")


def test_networks_are_drawn_with_any_names(tmp_path: Path) -> None:
    network = Network(HOSTILE)
    network.add_neuron(HOSTILE, Neuron())
    network.add_input(HOSTILE, HOSTILE)
    svg = network_svg(network)
    assert CONTROL.search(svg) is None
    ET.fromstring(svg)
    ET.parse(network_figure(network, tmp_path / "network.svg"))


def test_an_exported_view_shows_the_name_and_loads_nothing(tmp_path: Path) -> None:
    path = tmp_path / "walk.html"
    words = ["riddle2023-rods", "--set", "duration_s=0.05", "--set", f"name={json.dumps(NAME)}"]
    annelid("view", *words, "--export", path)
    page = path.read_text(encoding="utf-8")
    assert "alert(1)" not in page.replace("&lt;script&gt;alert(1)&lt;/script&gt;", "")
    assert "default-src 'none'" in page
    assert "connect-src blob: data:;" in page


def test_the_panel_of_a_view_shows_names_as_text() -> None:
    from annelid.live.panel import status_html

    assert {tag for tag, _ in Tags(status_html(NAME, [NAME], NAME)).found} == {"div", "b"}


def test_other_text_stays_as_it_is() -> None:
    for text in ("\U0001fab1", "a\u00a0b\u2009c", "two\nlines\t", "\u0939\u093f\u0928\u094d\u0926\u0940"):
        assert printable(text) == text
