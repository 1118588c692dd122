"""Files and texts from strangers: too long, too deep, not text at all. Each is refused in a sentence, at once."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from annelid import Network, simulate
from annelid.config import load_config, load_study
from annelid.errors import AnnelidError
from annelid.experiment.parameter_errors import read_spread
from annelid.nervous import Gate, Neuron, Synapse
from annelid.simulation import Run
from annelid.textfiles import MOST_BYTES, parse_toml
from annelid_lab.calibration import read_loop

LONGEST_S = 20.0
QUOTES = {
    "escaped quotes, not closed": 'x = "' + '\\"' * 500_000,
    "escaped quotes, three not closed": 'x = """' + '\\"""' * 250_000,
    "backslashes, not closed": 'x = "' + "\\" * 1_000_001,
    "dotted key behind five quotes": f"x = ['''a''''', '''\n''']\n{'.'.join(['a'] * 500_000)} = 1\n#'''",
    "dotted key, quoted": ".".join(['"a \\"b"'] * 200_000) + " = 1",
    "nearly a dotted key": ("a . " * 60 + ",") * 5000,
}
TOML = QUOTES | {
    "brackets": "x = " + "[" * 5000 + "]" * 5000,
    "inline tables": "x = " + "{a = " * 5000 + "1" + "}" * 5000,
    "dotted header": "[" + ".".join(["a"] * 200_000) + "]\nx = 1",
    "digits": "duration_s = " + "1" * 5000,
    "digits in base 16": "duration_s = 0x" + "f" * 100_000,
    "unknown keys": "[body.mesh]\n" + "".join(f"k{i} = {i}\n" for i in range(30_000)),
    "long name of a key": "a" * 1_000_000 + " = 1",
    "posts": f"[arena]\nposts = [{'[-3.0, 0.1, 0.1], ' * 20_000}]",
    "long text": f'duration_s = "{"x" * 1_000_000}"',
    "null": 'x = "\x00"',
    "empty key": '"" = 1',
}


def refused(attempt: Callable[[], object], longest_s: float = LONGEST_S) -> str:
    """The sentence of an attempt that must be refused, soon."""
    start = time.process_time()
    with pytest.raises(AnnelidError) as error:
        attempt()
    assert time.process_time() - start < longest_s
    sentence = str(error.value)
    assert "\n" not in sentence
    assert 10 < len(sentence) < 500
    return sentence


def test_strange_toml_is_refused_by_every_reader(tmp_path: Path, subtests: pytest.Subtests) -> None:
    path = tmp_path / "w.toml"
    for name, text in TOML.items():
        path.write_text(text, encoding="utf-8")
        with subtests.test(name):
            if name in QUOTES:
                refused(lambda text=text: parse_toml(text, "it"), 3.0)
                continue
            refused(lambda: load_config(path))
            if len(text) <= 200_000:
                refused(lambda: load_study(path))
                refused(lambda text=text: Network.from_toml(text))
                refused(lambda: load_config("riddle2023-rods", arena=path))


FILES: dict[str, Callable[[Path], object]] = {
    "folder": lambda path: path.mkdir(),
    "link to itself": lambda path: path.symlink_to(path),
    "endless device": lambda path: path.symlink_to("/dev/zero"),
    "pipe": lambda path: os.mkfifo(path),
    "not UTF-8": lambda path: path.write_bytes(b'x = "\xff\xfe"'),
    "too long": lambda path: path.write_bytes(b"#" * (MOST_BYTES + 1)),
    "missing": lambda _: None,
}


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has neither such devices nor such pipes")
def test_what_is_no_text_file_is_refused_by_every_reader(tmp_path: Path, subtests: pytest.Subtests) -> None:
    readers = [load_config, load_study, lambda p: load_config("crawler", arena=p)]
    for name, make in FILES.items():
        path = tmp_path / f"{name}.toml"
        make(path)
        with subtests.test(name):
            for read in [*readers, read_spread, read_loop]:
                assert path.name in refused(lambda read=read, path=path: read(path))


def test_strange_json_is_refused_by_every_reader(tmp_path: Path) -> None:
    path = tmp_path / "calibration.json"
    for text in ("[" * 100_000, '{"a":' * 100_000, "1" * 5000, "nul", '{"judged": 1}', ""):
        path.write_text(text, encoding="utf-8")
        refused(lambda: read_spread(path))


def test_files_that_extend_one_another_have_an_end(tmp_path: Path) -> None:
    for n, first in ((2, tmp_path / "w1.toml"), (1500, "riddle2023")):
        for i in range(n):
            base = first if i == 0 else tmp_path / f"w{i - 1}.toml"
            (tmp_path / f"w{i}.toml").write_text(f"extends = '{base}'", encoding="utf-8")
        assert "extend" in refused(lambda n=n: load_config(tmp_path / f"w{n - 1}.toml"))


def test_a_mapping_that_holds_itself_is_refused() -> None:
    tree: dict[str, object] = {"extends": "riddle2023"}
    tree["body"] = tree
    assert "too deeply" in refused(lambda: load_config(tree))
    assert "too deeply" in refused(lambda: load_study(tree))


def test_a_network_takes_no_number_that_is_not_finite_and_no_name_that_no_file_can_hold() -> None:
    for number in (float("nan"), float("inf"), -float("inf")):
        for part in (
            lambda number=number: Neuron(number),
            lambda number=number: Gate(number),
            lambda number=number: Synapse(number, 1.0),
            lambda number=number: Network().add_neuron("n", Neuron(), number),
            lambda number=number: Network.from_toml(f"[[neuron]]\nname = 'a'\nrest_mV = {number}"),
        ):
            assert "must be" in refused(part)
    for name in ("\ud800", 3, None):
        refused(lambda name=name: Network().add_neuron(name, Neuron()))  # type: ignore[arg-type]


def test_what_is_no_configuration_is_refused(tmp_path: Path) -> None:
    for config in (3, [], object(), {"durration_s": 1}, {"extends": "nothing"}):
        refused(lambda config=config: simulate(config, tmp_path / "run"))  # type: ignore[arg-type]
    assert not (tmp_path / "run" / "run.nc").exists()


def test_a_body_that_takes_hours_to_build_is_refused_with_an_estimate() -> None:
    largest = {"body.mesh.n_segments": 200, "body.mesh.n_helices": 96, "body.mesh.elements_per_side": 32}
    sentence = refused(lambda: load_config("riddle2023-rods", largest))
    assert all(path in sentence for path in largest)
    assert "GB" in sentence


def test_a_video_of_a_billion_pictures_is_refused(planar_run: Run, tmp_path: Path) -> None:
    from annelid.draw.render import render_video

    assert "speed = 1e-09" in refused(lambda: render_video(planar_run, tmp_path / "v.mp4", speed=1e-9))
    assert not (tmp_path / "v.mp4").exists()
