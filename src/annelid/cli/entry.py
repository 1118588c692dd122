# ruff: noqa: D301 -- the help texts need a real backspace: it keeps the lines of an example apart.
"""The application that the commands join: how it starts, and how an error ends it."""

from __future__ import annotations

import warnings
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from annelid.errors import AnnelidError, SimulationStopped

EXIT_USAGE = 2
EXIT_STOPPED = 3
EXIT_INTERRUPTED = 130


class _Sentences(TyperGroup):
    """Ends every error a user can act on with one sentence and an exit code, never with a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Runs the command."""
        try:
            return super().invoke(ctx)
        except SimulationStopped as stop:
            complain(stop)
            raise typer.Exit(EXIT_STOPPED) from None
        except AnnelidError as error:
            complain(error)
            raise typer.Exit(EXIT_USAGE) from None
        except BrokenPipeError:
            raise
        except RuntimeError as error:
            # What the engine says on import to a back-end it does not know.
            if "MUJOCO_GL" not in str(error):
                raise
            complain(error)
            raise typer.Exit(EXIT_USAGE) from None
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            complain(f"{where}{error.strerror or error}")
            raise typer.Exit(EXIT_USAGE) from None
        except MemoryError:
            complain("there is not enough memory for this: try fewer segments, or a smaller picture")
            raise typer.Exit(EXIT_USAGE) from None
        except ArithmeticError as error:
            complain(f"a number is too large or too small to compute with: {str(error) or type(error).__name__}")
            raise typer.Exit(EXIT_USAGE) from None
        except KeyboardInterrupt:
            complain("interrupted")
            raise typer.Exit(EXIT_INTERRUPTED) from None


app = typer.Typer(
    cls=_Sentences,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)


def main() -> None:
    """Entry point of the command ``annelid``."""
    warnings.showwarning = _complain_of_warning
    app(prog_name="annelid")


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
    """Simulate a soft, peristaltic earthworm robot driven by a synthetic nervous system.

    \b
    annelid run                        run the paper's robot with pins that hold: a few seconds
    annelid run riddle2023             run it as the paper built it: about a minute
    annelid run riddle2022-planar      run the planar worm: a few seconds
    annelid paper                      reproduce and examine the whole paper: about 40 minutes
    annelid bench                      speed and error side by side: about 15 minutes
    annelid presets                    what else there is
    annelid doctor                     is everything in place?
    """


def _complain_of_warning(message: Warning | str, *_: object, **__: object) -> None:
    complain(f"warning: {message}")


def complain(what: object) -> None:
    """Writes one line to stderr, whatever the line breaks in it."""
    typer.echo(f"annelid: {' '.join(str(what).split())}", err=True)
