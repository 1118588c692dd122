"""Builds the documentation site: gathers the pages, makes those that come from the code, runs the tutorials.

    python docs/site/build_site.py

writes the site into ``build/site``, whose ``index.html`` opens from disk. Whatever the generator warns of, a link that
leads nowhere for one, ends it with an error. Takes about a minute the first time, then seconds while neither tutorials
nor package change.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import yaml

import annelid
import command_reference
import configuration_reference
import examples_page
import notebooks
import numbers_reference
import run_file_reference
from navigation import expanded

ROOT = Path(__file__).parent.parent.parent
PAGES = ROOT / "docs"
SETTINGS = Path(__file__).parent / "site.yml"
GENERATED = {
    "examples.md": lambda: examples_page.page(ROOT / "examples"),
    "reference/commands.md": command_reference.page,
    "reference/configuration.md": configuration_reference.page,
    "reference/numbers.md": numbers_reference.page,
    "reference/run_file.md": run_file_reference.page,
}
"""What is added to pages that have only their introduction in the repository."""


def build(folder: Path) -> Path:
    """Builds the site.

    Args:
        folder: Where to work; its folders ``docs`` and ``site`` are replaced.

    Returns:
        The folder of the site, ``site`` in it.

    Raises:
        subprocess.CalledProcessError: The generator found something wrong, and has printed what.
        nbclient.exceptions.CellExecutionError: A cell of a tutorial failed.
    """
    pages, site = folder / "docs", folder / "site"
    gather(pages)
    settings = yaml.safe_load(SETTINGS.read_text(encoding="utf-8"))
    settings |= {"docs_dir": pages.name, "site_dir": site.name}
    settings["site_name"] += f" {annelid.__version__}"
    settings["nav"] = expanded(settings["nav"], [path.relative_to(pages).as_posix() for path in pages.rglob("*.md")])
    (folder / "mkdocs.yml").write_text(yaml.safe_dump(settings, sort_keys=False), encoding="utf-8")
    shutil.rmtree(site, ignore_errors=True)
    command = [sys.executable, "-m", "zensical", "build", "--clean", "--strict", "-f", str(folder / "mkdocs.yml")]
    # Where the generator finds our extension, `mathematics`.
    found = os.pathsep.join(filter(None, [str(Path(__file__).parent), os.environ.get("PYTHONPATH")]))
    subprocess.run(command, check=True, env=os.environ | {"PYTHONPATH": found})
    return site


def gather(target: Path) -> None:
    """Puts all pages into a folder: those of the repository, those made from the code, and the tutorials as run."""
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(PAGES, target, ignore=shutil.ignore_patterns(Path(__file__).parent.name))
    for name, page in GENERATED.items():
        with (target / name).open("a", encoding="utf-8") as introduced:
            introduced.write(f"\n{page()}")
    for tutorial in sorted((PAGES / "tutorials").glob("*.md")):
        shown = notebooks.run(tutorial.read_text(encoding="utf-8"), tutorial.stem)
        (target / "tutorials" / tutorial.name).write_text(shown.markdown, encoding="utf-8")
        for name, content in shown.files.items():
            (target / "tutorials" / name).write_bytes(content)


if __name__ == "__main__":
    try:
        print(build(ROOT / "build") / "index.html")
    except subprocess.CalledProcessError as failure:
        sys.exit(failure.returncode)
