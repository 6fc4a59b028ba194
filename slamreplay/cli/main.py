"""The `slamreplay` program: its commands, and what every one of them does with a fault."""

from __future__ import annotations

import sys
from importlib import import_module

import typer

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Replay a robot's log and say whether the robot was lost or the map had changed.",
)

#: Command modules; each registers one command on `app` by a function `register(app)`.
COMMANDS = ()


def main() -> None:
    """Run the program; faults the user can mend become one line and exit code 2."""
    for name in COMMANDS:
        import_module(f"slamreplay.cli.{name}").register(app)
    app()


if __name__ == "__main__":
    sys.exit(main())
