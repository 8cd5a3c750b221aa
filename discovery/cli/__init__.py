"""The command line: one verb a stage; exit status 0 done, 2 bad input or usage, 3 a computation that failed.

Every command imports what it needs when it runs, so that the help is there at once.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from contextlib import suppress
from typing import NoReturn

import click

from discovery.cli import answers, campaigns, export, sources, stages
from discovery.cli.streams import is_of_output, open_streams, unwritten

# Linear algebra here is small: a second BLAS thread only spins beside the kernel's own. Set before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


#: An interruption that was dropped comes again after so long [s].
_SOON = 0.05
#: What an interruption leaves of a command's work; of any other, nothing.
_RESUMED = {
    "campaign": "the same command goes on from what is finished",
    "posterior": "the same command fits again and goes on with the chains that were being sampled",
    "run": "the answer stays once it is said; the same command fits again and goes on with the posterior where it was",
}


def _say_version(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    """Say the version, and the revision where the source tree has one, and leave."""
    if not wanted:
        return
    from importlib.metadata import version

    from discovery.foundation.revision import git_revision

    revision = git_revision()
    click.echo(f"discovery {version('discovery')}" + (f", revision {revision}" if revision else ""))
    context.exit()


#: What does the work of commands that there are not.
_INSTEAD = {"predict": "`discovery loop RIG --predict FILE` predicts another recording"}


class _Commands(click.Group):
    """The commands, and for those that there are not what does their work."""

    def resolve_command(
        self, context: click.Context, arguments: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that is asked for."""
        if self.get_command(context, arguments[0]) is None and arguments[0] in _INSTEAD:
            context.fail(f"No such command '{arguments[0]}': {_INSTEAD[arguments[0]]}.")
        return super().resolve_command(context, arguments)


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_say_version,
    help="Show the version with its revision, and exit.",
)
def cli() -> None:
    """Discover the equation of motion of a mechanical system, and find the effect that its model lacks."""


_ROOMS = (answers, stages, campaigns, export, sources)
for _command in (command for room in _ROOMS for command in room.COMMANDS):
    cli.add_command(_command)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its status.

    Parameters
    ----------
    arguments : list of str, optional
        In the place of the process's own. Where it has its own, an interruption ends it at once, its threads included.
    """
    from discovery.foundation.errors import ComputationError, InputError

    if arguments is None:
        open_streams()
        signal.signal(signal.SIGTERM, _end_at_once)
        sys.unraisablehook = _interrupted_unheard
    try:
        cli.main(arguments, prog_name="discovery", standalone_mode=False)
    except click.exceptions.Abort as error:
        _leave(arguments, error.__cause__)
    except BrokenPipeError as error:
        # Whoever reads in a pipe may have been interrupted, too.
        if not isinstance(error.__context__, KeyboardInterrupt):
            raise
        _leave(arguments, error.__context__)
    except click.ClickException as error:
        with suppress(OSError):
            error.show()
        sys.exit(2)
    except InputError as error:
        _end(str(error), 2)
    except ComputationError as error:
        _end(str(error), 3)
    except MemoryError:
        _end("The memory of this machine is not enough. Give shorter or fewer recordings.", 3)
    except OSError as error:
        _end(_refused(error), 3)
    if (lost := unwritten()) is not None:
        if isinstance(lost, BrokenPipeError):
            # A reader that has enough, such as `head`, is told no more than one that a single line is too much for.
            sys.exit(1)
        _end(_lost(lost), 3)


def _end(message: str, status: int) -> NoReturn:
    """Say why a command did not succeed, and exit."""
    unwritten()
    with suppress(OSError):
        click.echo(f"discovery: {message}", err=True)
    sys.exit(status)


def _refused(error: OSError) -> str:
    """Return what the system refused, and what to do about it."""
    if is_of_output(error):
        return _lost(error)
    place = f"{error.filename}: " if error.filename else ""
    return (
        f"{place}{error.strerror or error}. The system refused it; no file of results is half-written. Make room or "
        "correct the permissions, and give the same command again."
    )


def _lost(error: OSError) -> str:
    return (
        f"Standard output cannot be written: {error.strerror or error}. What was to be printed is lost; files that "
        "were written before are whole. Make room, or send the output elsewhere, and give the same command again."
    )


class _Terminated(KeyboardInterrupt):
    """The system asks the process to end, as when the machine shuts down: it ends as by Ctrl-C."""


def _end_at_once(*_: object) -> NoReturn:
    raise _Terminated


def _interrupted_unheard(lost: sys.UnraisableHookArgs) -> None:
    """Interrupt once more where an interruption fell into the end of an object's life, where Python drops it."""
    if not isinstance(lost.exc_value, KeyboardInterrupt):
        return sys.__unraisablehook__(lost)
    sent = signal.SIGTERM if isinstance(lost.exc_value, _Terminated) else signal.SIGINT
    # What rings by itself, as the limit of `--max-time`, rings again.
    if type(lost.exc_value) in (KeyboardInterrupt, _Terminated):
        threading.Timer(_SOON, os.kill, (os.getpid(), sent)).start()
    return None


def _leave(arguments: list[str] | None, reason: BaseException | None) -> None:
    """Say what an interruption leaves, and exit."""
    status = 128 + (signal.SIGTERM if isinstance(reason, _Terminated) else signal.SIGINT)
    # The group's own options end the call: what comes first is the command.
    given = (sys.argv[1:] if arguments is None else arguments)[:1]
    left = _RESUMED.get(given[0] if given else "", "give the same command to start over")
    with suppress(BrokenPipeError):
        click.echo(f"interrupted: no file is half-written; {left}", err=True)
        sys.stdout.flush()
    if arguments is None:
        # The process would wait for threads that compile or simulate.
        os._exit(status)
    sys.exit(status)
