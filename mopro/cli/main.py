"""The command group, and what every command shares.

Exit codes: 0 done, 1 findings or a failed run, 2 wrong use or unreadable input, 70 a fault of mopro
itself, which scripts must not read as findings.
"""

from __future__ import annotations

import atexit
import gc
import importlib
import io
import re
import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Iterator
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, NoReturn

import click

from mopro.cli.say import discard_output, give_up_errors, prepare_streams, say, say_findings
from mopro.errors import Interrupted, LinkError, MoproError, PortError, RunError
from mopro.process.loading import load_elsewhere, make_sure_on_import

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

EXIT_FAILED = 1
EXIT_BAD_INPUT = 2
# As the interpreter gives 1 for a traceback, and sysexits.h calls an error within a program.
EXIT_FAULT = 70
EXIT_SIGNAL = 128
# Time in which a library's callback that swallowed a signal returns; half or double is no matter.
_AGAIN_S = 0.01
# New objects between two searches for cyclic garbage. Imports and lists of samples make 100,000
# that stay, and with Python's 700 searches among them are a twentieth of the time of a run of three
# seconds; halved or doubled, it makes no difference that could be measured.
_OBJECTS_TO_SEARCH = 50_000

# What libraries, the loader and the interpreter say where memory is lacking.
_NO_MEMORY = re.compile(
    "cannot allocate memory|failed to map segment|can't start new thread|launch worker thread"
    "|without setting an exception|without exception set",
    re.IGNORECASE,
)

# command -> the module that has it, and its name there; loaded when the command is used.
COMMANDS = {
    "blind": "mopro.cli.blind:command",
    "compare": "mopro.cli.compare:command",
    "completion": "mopro.cli.starting:completion",
    "compile": "mopro.cli.program_files:compile_file",
    "flash": "mopro.cli.link:flash",
    "import": "mopro.cli.logs:import_logs",
    "init": "mopro.cli.starting:init",
    "fmt": "mopro.cli.program_files:fmt",
    "limits": "mopro.cli.machine_files:limits",
    "link-test": "mopro.cli.link:link_test",
    "lint": "mopro.cli.lint:command",
    "lsp": "mopro.cli.program_files:lsp",
    "machine": "mopro.cli.machine_files:machine",
    "measure": "mopro.cli.measure:command",
    "noise": "mopro.cli.logs:noise",
    "optimize": "mopro.cli.optimize:command",
    "ports": "mopro.cli.link:ports",
    "reconcile": "mopro.cli.reconcile:command",
    "run": "mopro.cli.run:command",
    "serve": "mopro.cli.serve:command",
    "sweep": "mopro.cli.sweep:command",
    "thesis": "mopro.cli.machine_files:thesis",
}


class _Lazy(click.Group):
    """Loads a command's module only when it is asked for, so that each starts fast."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, _, name = COMMANDS[cmd_name].partition(":")
        command: click.Command = getattr(importlib.import_module(module), name)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does, and with the commands that a mistyped one may stand for."""
        try:
            return super().resolve_command(ctx, args)
        except click.exceptions.NoSuchCommand as error:
            raise click.exceptions.NoSuchCommand(args[0], None, COMMANDS, ctx) from error


@click.group(cls=_Lazy, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="mopro")
def group() -> None:
    """Compile, run and check programs of the MoPro motion-control language.

    Example: mopro run programs/LVDT3.CMD --emulate
    """


def main() -> NoReturn:
    """Run the command line and exit."""
    _search_less_garbage()
    _heed_signals()
    make_sure_on_import()
    load_elsewhere()
    prepare_streams()
    sys.excepthook = _end_at_fault
    atexit.register(give_up_errors)
    try:
        with _LackOfMemory():
            code = group(standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except click.ClickException as error:
        shown = io.StringIO()
        error.show(file=shown)
        say(shown.getvalue(), err=True, nl=False)
        sys.exit(error.exit_code)
    except click.Abort as error:
        _heed_no_longer()
        notes = getattr(error.__cause__, "__notes__", ())
        say("\n".join(["mopro: interrupted", *notes]), err=True)
        discard_output()
        sys.exit(EXIT_SIGNAL + signal.SIGINT)
    except MoproError as error:
        say_findings(error.render(), err=True)
        failed = isinstance(error, LinkError | RunError) and not isinstance(error, PortError)
        sys.exit(EXIT_FAILED if failed else EXIT_BAD_INPUT)
    except MemoryError:
        say("mopro: there is not enough memory for this input [no-memory]", err=True)
        sys.exit(EXIT_BAD_INPUT)
    except BrokenPipeError:
        # Whoever read our output has gone; say nothing more, not even at exit.
        discard_output()
        sys.exit(EXIT_FAILED)
    except OSError as error:
        # What files are read and written tells its own errors: this is standard output.
        discard_output()
        reason = error.strerror or str(error)
        say(f"mopro: the output cannot be written: {reason} [unwritable-output]", err=True)
        sys.exit(EXIT_BAD_INPUT)


def _end_at_fault(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> NoReturn:
    """Print what no command foresaw, and exit."""
    sys.__excepthook__(kind, error, trace)
    sys.exit(EXIT_FAULT)


def _search_less_garbage() -> None:
    """Search for cyclic garbage seldom, and not at the exit, which frees all memory anyway."""
    gc.set_threshold(_OBJECTS_TO_SEARCH)
    atexit.register(gc.freeze)


class _LackOfMemory:
    """Context in which a library's error that stands for a MemoryError becomes one."""

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: object
    ) -> None:
        if isinstance(error, MoproError | click.ClickException | click.Abort):
            return
        if isinstance(error, Exception) and any(map(_tells_of_no_memory, _chain(error))):
            raise MemoryError from error


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """An error, and those that it came from."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _tells_of_no_memory(error: BaseException) -> bool:
    return isinstance(error, MemoryError) or bool(_NO_MEMORY.search(str(error)))


def _heed_signals() -> None:
    """Have SIGINT (unless it is ignored) and SIGTERM end this process in order."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
    sys.unraisablehook = _unraisable


def _heed_no_longer() -> None:
    """Have a further signal end this process at once: what is still to be said may not be taken."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is _interrupt:
            signal.signal(number, signal.SIG_DFL)


def _interrupt(number: int, frame: FrameType | None) -> NoReturn:
    """Unwind as for Ctrl-C, so that files are left whole."""
    raise Interrupted(number)


def _unraisable(lost: UnraisableHookArgs) -> None:
    """Raise a signal again that came within a library's callback, where nothing can be raised.

    Of a lack of memory there nothing is said: what needs memory next says so.
    """
    if isinstance(lost.exc_value, Interrupted):
        again = threading.Timer(_AGAIN_S, _signal_main, (lost.exc_value.args[0],))
        again.daemon = True
        again.start()
    elif not isinstance(lost.exc_value, MemoryError):
        sys.__unraisablehook__(lost)


def _signal_main(number: int) -> None:
    if sys.platform == "win32":
        interrupt_main(number)
    else:  # also wakes a thread that waits
        signal.pthread_kill(threading.main_thread().ident or 0, number)
