"""Command line: each sub-command is a thin wrapper around a public function."""

import atexit
import gc
import sys
import warnings

import click

from .cli.interrupt import EXIT_CODE
from .cli.output import FAILED, HOLDS, USAGE
from .discovery import Members, command_names
from .errors import InputError, MbdaeError, printable

GC_THRESHOLD = 150_000  # new objects before a garbage collection: more than a run creates, and nearly all stay alive


COMMANDS = Members(command_names("mbdae.studies"), lambda module, name: getattr(module, name.replace("-", "_")))


@click.group(commands=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="mbdae")
def cli() -> None:
    """Simulate constrained mechanisms, check the result, and replay it."""


def main() -> None:
    """Entry point: errors are one line on stderr; exit codes as in `mbdae.cli.output`, 130 for Ctrl-C."""
    gc.set_threshold(GC_THRESHOLD)
    atexit.register(gc.freeze)  # otherwise the collection at exit takes as long as a run
    warnings.showwarning = lambda message, *_: _print_error(f"warning: {message}")  # type: ignore[assignment]
    try:
        sys.exit(cli(standalone_mode=False) or HOLDS)
    except click.exceptions.NoArgsIsHelpError as e:
        click.echo(e.format_message())
        sys.exit(USAGE)
    except click.ClickException as e:
        _print_error(e.format_message())
        sys.exit(USAGE)
    except MbdaeError as e:
        _print_error(str(e))
        sys.exit(USAGE if isinstance(e, InputError) else FAILED)
    except MemoryError as e:
        _print_error(f"not enough memory: {e or 'std::bad_alloc'}")
        sys.exit(FAILED)
    except (click.exceptions.Abort, KeyboardInterrupt):
        _print_error("stopped by the user")
        sys.exit(EXIT_CODE)


def _print_error(text: str) -> None:
    """Print one line on stderr; names from files may contain any characters."""
    click.echo(printable(" ".join(f"mbdae: {text}".split("\n"))), err=True)


if __name__ == "__main__":
    main()
