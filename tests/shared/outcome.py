"""What a command printed and how it ended."""

from __future__ import annotations

from collections.abc import Callable

STUDY = """
preset = "riddle2022-planar"
set.duration_s = 0.1
[[vary]]
field = "body.gain"
values = [{values}]
"""
"""A sweep of a planar worm, to be filled with values of one field; 1e4 makes a run fail."""


class Outcome:
    """What a command printed and how it ended."""

    def __init__(self, exit_code: int, out: str, err: str) -> None:
        self.exit_code, self.out, self.err = exit_code, out, err

    def sentence(self) -> str:
        """The one sentence on stderr that a user error ends with; fails if there is anything else."""
        assert "Traceback" not in self.out + self.err
        lines = self.err.splitlines()
        assert [line[:2] for line in lines] == ["an", *["  "] * (len(lines) - 1)], self.err
        assert lines[0].startswith("annelid: ")
        return " ".join(map(str.strip, lines)).removeprefix("annelid: ")


Command = Callable[..., Outcome]
