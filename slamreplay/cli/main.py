"""The `slamreplay` program: its commands, and what every one of them does with a fault."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
import traceback
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from slamreplay.caches import cache_folder
from slamreplay.cli.terminal import complain, settle_streams
from slamreplay.errors import SlamreplayError
from slamreplay.kernel_cache import keep_kernels
from slamreplay.version import __version__

#: Exit codes of design: 1 is raised by the commands that were asked to judge (`--fail-on`).
EXIT_INPUT, EXIT_FAULT, EXIT_INTERRUPTED = 2, 70, 130

#: Command modules, in the order of the help; each has `register(app)` and imports nothing heavy.
COMMANDS = (
    "report", "gate", "batch", "watch", "ingest", "inspect", "perturb", "export", "simulate",
    "bench", "explain", "list_",
)  # fmt: skip

#: What every usage error is: typer carries a click of its own, so it is asked for its base class.
_UsageFault: type[Any] = typer.BadParameter.__mro__[2]

app = typer.Typer(
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Replay a robot's log and say whether the robot was lost or the map had changed.",
)


def _print_version(value: bool) -> None:
    if value:
        typer.echo(f"slamreplay {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of a fault.")] = False,
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Options that hold for every command."""


def main() -> None:
    """Run the program; a fault the user can mend becomes one line and exit code 2."""
    sys.exit(run())


def run() -> int:
    """The exit code of the command in `sys.argv`."""
    debug = "--debug" in sys.argv
    settle_streams()
    keep_kernels(cache_folder())
    try:
        for name in COMMANDS:
            import_module(f"slamreplay.cli.{name}").register(app)
        return int(app(sys.argv[1:] or ["--help"], standalone_mode=False) or 0)
    except _UsageFault as error:
        where = error.ctx.command_path if getattr(error, "ctx", None) else "slamreplay"
        message = " ".join(error.format_message().split()).rstrip(".").replace("Value error, ", "")
        complain(f"slamreplay: {message} (hint: see {where} --help)")
        return EXIT_INPUT
    except (typer.Abort, KeyboardInterrupt):
        complain("stopped")
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # the reader of our output went away: `slamreplay inspect B | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except SlamreplayError as error:
        if debug:
            traceback.print_exc()
        complain(f"slamreplay: {error}")
        return EXIT_INPUT
    except Exception as error:  # the last resort: whatever gets here is a fault of ours
        if debug:
            traceback.print_exc()
        complain(
            f"slamreplay: a fault of ours: {type(error).__name__}: {str(error)[:200]} "
            f"(written to {_crash_file()}; --debug shows it)"
        )
        return EXIT_FAULT


def _crash_file() -> Path:
    """Where the traceback was written: the cache folder, or the temporary one if that fails."""
    told = f"slamreplay {__version__}\n{' '.join(sys.argv)}\n\n{traceback.format_exc()}"
    text = told.encode(errors="backslashreplace")  # names of files need not be UTF-8
    name = f"crash-{hashlib.sha256(text).hexdigest()[:12]}.txt"
    for folder in (cache_folder(), Path(tempfile.gettempdir())):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(text)
        except OSError:
            continue
        return folder / name
    return Path(os.devnull)


if __name__ == "__main__":
    main()
