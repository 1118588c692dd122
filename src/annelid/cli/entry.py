"""The application that the commands join: how it starts, and how an error ends it."""

from __future__ import annotations

import os
import shlex
import signal
import sys
import warnings
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from contextvars import ContextVar
from io import TextIOWrapper
from math import isfinite
from pathlib import Path
from textwrap import fill
from typing import Annotated, Any, TextIO

import typer
from typer.core import TyperCommand, TyperGroup

from annelid.cli.json_output import with_json
from annelid.errors import AnnelidError, ConfigError, RunKilled, SimulationStopped, shown, suggest
from annelid.text import LINE, write_printable_only

EXIT_DONE = 0
"""Everything that was asked for is there."""
EXIT_BUG = 1
"""An error that annelid does not expect, with a traceback; or nobody reads any more what is printed, without a word."""
EXIT_USAGE = 2
"""Refused: the command, a file, a field, a missing program; what to do is in the sentence."""
EXIT_STOPPED = 3
"""A guard stopped the run, or runs of a study; all others are there."""
EXIT_SOME_FAILED = 4
"""Runs of a study could not be computed; the results of all others are written."""
EXIT_ALL_FAILED = 5
"""No run of a study could be computed, or a search found nothing."""
EXIT_INTERRUPTED = 130
"""Ended by Ctrl-C, SIGTERM or SIGHUP; what was finished is kept."""


PANELS = ("Make", "See", "Vary", "Exchange", "Robot", "Studies", "Help")
"""Headings of the help, below which the commands stand in the order in which they join."""
OLD_COMMANDS: Mapping[str, tuple[str, ...]] = {
    "build": ("export", "--to", "mjcf"),
    "experiment": ("study",),
    "pseudo-robot": ("loop", "--pseudo"),
    **dict.fromkeys(("plot", "render"), ("draw",)),
    **{name: ("list", name) for name in ("presets", "arenas", "runs")},
    **{name: ("study", name) for name in ("limit-cycle", "bench", "robustness", "challenge")},
}
"""What commands of before are now; they go on for one release (docs/roadmap.md lists them)."""
WIDEST = 200
"""Characters of a command's line in the help, which goes on in the next line and is never cut."""

_locks: ContextVar[ExitStack] = ContextVar("_locks")
_typed: ContextVar[tuple[str, ...]] = ContextVar("_typed", default=())
"""The command and the words after it, as the user gave them."""


class _Panels(TyperGroup):
    """Lists its commands by panel, no line of them cut."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Writes the panels that have a command; what is in none stands below "Commands"."""
        known = [(name, self.commands[name]) for name in self.list_commands(ctx) if not self.commands[name].hidden]
        for panel in (*PANELS, "Commands"):
            rows = [(name, one.get_short_help_str(WIDEST)) for name, one in known if _panel_of(one) == panel]
            if rows:
                with formatter.section(panel):
                    formatter.write_dl(rows)


class _Sentences(_Panels):
    """Ends every error a user can act on with one sentence and an exit code, never with a traceback."""

    def main(self, *args: Any, **options: Any) -> Any:
        """Parses the command line and runs the command; what cannot be printed is an error too."""
        write_printable_only()
        try:
            try:
                return super().main(*args, **options)
            finally:
                sys.stdout.flush()
        except OSError as error:
            _throw_away(sys.stdout)
            if isinstance(error, BrokenPipeError):
                sys.exit(EXIT_BUG)
            complain(f"cannot print: {error.strerror or error}")
            sys.exit(EXIT_USAGE)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Finds a command, by its old name with a hint."""
        if (now := OLD_COMMANDS.get(args[0])) is not None:
            complain(f"hint: annelid {args[0]} is now annelid {' '.join(now)}; the old name goes with the next release")
            args = [*now, *args[1:]]
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Runs the command."""
        try:
            with ExitStack() as stack:
                _locks.set(stack)
                return super().invoke(ctx)
        except (Exception, KeyboardInterrupt) as error:
            ending = _ending(error)
            if ending is None:
                raise
            sentence, code = ending
            complain(sentence)
            raise typer.Exit(code) from None


def _panel_of(command: Any) -> str:
    return command.rich_help_panel if isinstance(command.rich_help_panel, str) else "Commands"


def _ending(error: BaseException) -> tuple[object, int] | None:
    """Returns the sentence and the exit code of an error that a user can act on."""
    match error:
        case SimulationStopped():
            return error, EXIT_STOPPED
        case RunKilled():
            return error, EXIT_SOME_FAILED
        case AnnelidError():
            return error, EXIT_USAGE
        case KeyboardInterrupt():
            return "interrupted", EXIT_INTERRUPTED
        case BrokenPipeError():
            return None
        # What the engine says on import to a back-end it does not know.
        case RuntimeError() if "MUJOCO_GL" in str(error):
            return error, EXIT_USAGE
        case OSError():
            # A stream or a file that is already open has no name.
            where = error.filename or "cannot print, or write a file"
            return f"{where}: {error.strerror or error}", EXIT_USAGE
        case MemoryError():
            return "there is not enough memory for this: try fewer segments, or a smaller picture", EXIT_USAGE
        case UnicodeError():
            return f"a text cannot be written or read: {error}", EXIT_USAGE
        case ArithmeticError():
            what = str(error) or type(error).__name__
            return f"a number is too large or too small to compute with: {what}", EXIT_USAGE
    return None


class Command(TyperCommand):
    """A command whose numbers are all finite, so that none of them makes it compute for ever."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Reads the options, and refuses infinite ones and those that are not a number."""
        _typed.set((*ctx.command_path.split()[1:], *args))
        rest = super().parse_args(ctx, args)
        for parameter in self.params:
            value = ctx.params.get(parameter.name)
            if isinstance(value, float) and not isfinite(value):
                raise typer.BadParameter(
                    f"{value} is not a finite number.", ctx=ctx, param_hint=f"'{parameter.opts[0]}'"
                )
        return rest


app = typer.Typer(
    cls=_Sentences,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
lists = typer.Typer(cls=_Panels, no_args_is_help=True, help="List presets, arenas, numbers or runs.")
app.add_typer(lists, name="list", rich_help_panel="Make")
studies = typer.Typer(cls=_Panels, no_args_is_help=True, help="Do one of the studies that the pages report.")
app.add_typer(studies, name="study", rich_help_panel="Studies")

Function = Callable[..., None]


def command(name: str, panel: str, *, as_json: bool = True) -> Callable[[Function], Function]:
    """Returns a decorator that makes a function the command `annelid NAME`, its parameters as Typer's.

    Args:
        name: Name of the command.
        panel: Heading of the help that it stands under, one of `PANELS`; empty for a command that the help leaves out.
        as_json: Whether it has the option ``--json`` beside its parameters.

    Raises:
        ConfigError: There is no such panel.
    """
    if panel and panel not in PANELS:
        raise ConfigError(f"command {name!r}: panel = {shown(panel)}: {suggest(panel, PANELS)}")
    return _joins(app, name, as_json=as_json, hidden=not panel, rich_help_panel=panel)


def study(name: str) -> Callable[[Function], Function]:
    """Returns a decorator that makes a function the command `annelid study NAME`, as `command` does."""
    return _joins(studies, name)


def listing(name: str) -> Callable[[Function], Function]:
    """Returns a decorator that makes a function the command `annelid list NAME`, as `command` does."""
    return _joins(lists, name)


def _joins(group: typer.Typer, name: str, *, as_json: bool = True, **options: Any) -> Callable[[Function], Function]:
    def join(function: Function) -> Function:
        group.command(name, cls=Command, **options)(with_json(function) if as_json else function)
        return function

    return join


def main() -> None:
    """Entry point of the command ``annelid``."""
    warnings.showwarning = lambda message, *_, **__: remark(f"warning: {message}")
    # Further signals end a command in good order; one that the process ignores from its start stays ignored.
    for number in (getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)):
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.default_int_handler)
    _open_what_is_closed()
    # Pictures are drawn into files only; another back-end, or one that does not exist, would serve nothing.
    os.environ["MPLBACKEND"] = "agg"
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    app(prog_name="annelid")


def _open_what_is_closed() -> None:
    """Throws away what is printed to a closed stream; else the next file to be opened would take its number."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(number)
    for name, number in (("stdout", 1), ("stderr", 2)):
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, "w", encoding="utf-8"))  # noqa: SIM115 -- open to the end


def _throw_away(stream: TextIO) -> None:
    """Sends nowhere what is still to be written to a stream that fails: it would fail again when Python ends."""
    with suppress(OSError, ValueError), open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), stream.fileno())


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"annelid {version('annelid')}")
        raise typer.Exit


@app.callback()
def _start(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Simulate a soft earthworm robot that crawls by peristalsis and is driven by a synthetic nervous system.

    \b
    annelid run                        the paper's worm: a few seconds
    annelid run riddle2023             in the paper's own formulation: a minute
    annelid run riddle2022-planar      the planar worm: a few seconds
    annelid list presets               all worms
    annelid study paper                the report on the whole paper: an hour
    annelid doctor                     what is missing on this machine

    Exit codes: 0 done, 2 refused, 3 stopped by a guard, 4 runs failed, 5 all runs failed, 130 interrupted, 1 anything
    unexpected. With --json, a command prints its result as one JSON document.
    """


def end_study(n_runs: int, failed: int, reasons: object, *, stopped: int = 0) -> None:
    """Ends a study's command with a sentence and an exit code where runs failed, or were stopped by a guard.

    The sentence names where the reasons can be read.

    Args:
        n_runs: Runs of the study.
        failed: Of them, those that could not be computed.
        reasons: The file that has the reasons.
        stopped: Of them, those that a guard stopped.

    Raises:
        Exit: Runs failed or were stopped.
    """
    if counts := [f"{n} {what}" for n, what in ((failed, "failed"), (stopped, "were stopped by a guard")) if n]:
        complain(f"of {n_runs} runs {' and '.join(counts)}: the reasons are in {reasons}")
        raise typer.Exit(EXIT_ALL_FAILED if failed == n_runs else EXIT_SOME_FAILED if failed else EXIT_STOPPED)


def typed_command(*further: str) -> str:
    """Returns the command line that the user gave, with further words."""
    return shlex.join(["annelid", *_typed.get(), *further])


def lock(folder: Path, *, new: bool = False) -> None:
    """Keeps other writers out of a folder, as `annelid.simulation.lock.locked` does, until the command ends.

    Args:
        folder: The folder.
        new: Whether it must not be there yet.
    """
    from annelid.simulation.lock import locked

    _locks.get().enter_context(locked(folder, new=new))


def complain(what: object, command: str = "") -> None:
    """Writes one line to stderr, whatever the line breaks in it, if stderr can be written.

    Args:
        what: The line.
        command: What to type next, on a line of its own.
    """
    _write_error(" ".join(str(what).split()) + (f"\n  {command}" if command else ""))


def remark(what: object) -> None:
    """Writes a note or a warning to stderr, which names no command to copy, in lines of `LINE` characters."""
    _write_error(
        fill(str(what), LINE - len("annelid: "), break_long_words=False, break_on_hyphens=False, subsequent_indent="  ")
    )


def _write_error(text: str) -> None:
    try:
        typer.echo(f"annelid: {text}", err=True)
    except OSError:
        _throw_away(sys.stderr)
