"""The command `view`: what it refuses, what it exports, and how it ends."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import urllib.parse
import urllib.request
from pathlib import Path

import pytest
from typer.testing import CliRunner

from annelid.cli import app


def refusal(*words: str) -> str:
    result = CliRunner().invoke(app, ["view", *words])
    assert result.exit_code == 2, result.output
    return " ".join(result.output.split())


def test_what_cannot_be_viewed_or_served_is_refused(tmp_path: Path) -> None:
    assert "did you mean 'riddle2023'" in refusal("ridle2023")
    assert "there is no such address" in refusal("--no-open", "--host", "no.such.host.invalid")
    assert "played as it was" in refusal(str(tmp_path), "--segments", "4")
    assert "there is no run file" in refusal(str(tmp_path))
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert f"--port {port} cannot be listened on" in refusal("--no-open", "--port", str(port))


def test_a_page_is_not_overwritten_and_goes_without_a_window(tmp_path: Path) -> None:
    page = tmp_path / "walk.html"
    page.write_text("mine")
    assert "name another file with --export, or replace it with --force" in refusal("--export", str(page))
    assert page.read_text() == "mine"
    assert "its name must end in .html" in refusal("--export", str(tmp_path / "walk.pdf"))


def test_a_worm_is_exported_as_one_page(tmp_path: Path) -> None:
    page = tmp_path / "walk.html"
    result = CliRunner().invoke(app, ["view", "--set", "duration_s=0.2", "--export", str(page)])
    assert result.exit_code == 0, result.output
    assert result.output.strip() == str(page)
    text = page.read_text(encoding="utf-8")
    assert "__VISER_EMBED_DATA__" in text
    assert "<title>riddle2023-rods - annelid</title>" in text


def test_without_viser_the_line_that_installs_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    for name in ("server", "show", "page"):
        monkeypatch.delitem(sys.modules, f"annelid.live.{name}", raising=False)
    assert "pip install 'annelid[view]'" in refusal("--no-open")


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT to send")
def test_it_serves_this_machine_only_and_ends_on_ctrl_c() -> None:
    command = [sys.executable, "-m", "annelid", "view", "--no-open", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as view:
        try:
            assert view.stdout is not None
            address = view.stdout.readline().split()[0]
            with urllib.request.urlopen(address, timeout=60) as answer:
                assert b"<html" in answer.read(2000)
            port = urllib.parse.urlsplit(address).port
            assert port is not None
            other = subprocess.run(
                ["hostname", "-I"], capture_output=True, text=True, check=False, timeout=120
            ).stdout.split()
            for own_address in other[:1]:
                with pytest.raises(ConnectionRefusedError):
                    socket.create_connection((own_address, port), timeout=2).close()
            view.send_signal(signal.SIGINT)
            _, errors = view.communicate(timeout=60)
        finally:
            view.kill()
    assert view.returncode == 0
    assert errors == ""
