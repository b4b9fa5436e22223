"""Attacks that once broke something, and the tests that try them again."""

# A file stands for all of its tests, a name behind it for those that begin so.
ATTACKS: dict[str, tuple[str, ...]] = {
    "modules of the current folder, for each command that starts a process": (
        "process/test_current_folder.py::test_a_",
        "process/test_current_folder.py::test_processes",
    ),
    "a status that says something else once, an end before its time, a cable moved to "
    "another controller": ("link/test_course.py",),
    "a trace, a recording, a report that nobody reads; a held terminal; a standard output "
    "that is gone while a run fails": (
        "link/test_writer.py",
        "cli/test_stop.py::test_a_trace",
        "cli/test_stop.py::test_a_signal_ends_a_run_whose_trace_blocks",
        "cli/test_stop.py::test_a_report_that_nobody_reads",
        "cli/test_stop.py::test_trouble_is_told",
        "cli/test_terminal.py::test_a_terminal_that_is_held",
        "link/test_endings.py::test_trouble_at_a_random_moment_ends_in_a_stop[",
    ),
    "numbers of 310 digits, of any base, with any exponent, calls with any arguments, in "
    "each place that takes a formula; sizes and starts that are none": ("formula/test_numbers.py",),
    "models that run away within a search: infinite, NaN, or larger than any power of them is": (
        "engine/residuals/test_whitened.py::test_a_prediction_that_runs_away",
        "engine/residuals/test_whitened.py::test_an_effect_that_runs_away",
        "engine/residuals/test_whitened.py::test_a_descent_that_begins",
        "engine/residuals/test_whitened.py::test_what_has_run_away",
        "cli/test_run_away.py",
        "plant/test_stepped_heat.py::test_a_temperature_that_runs_away",
        "experiment/test_force.py",
    ),
    "a `matplotlibrc` (`text.usetex`, nonsense, a pipe) or a numba configuration in the current "
    "folder": ("process/test_current_folder.py::test_settings", "plot/test_style.py"),
    "pipes, folders, sockets, devices, dangling links instead of input files, named by "
    "commands and by files": ("cli/test_no_files.py", "blind/test_no_files.py"),
    "the token of a live page in the arguments of a browser": (
        "viewer/test_server.py::test_the_token",
        "viewer/test_server.py::test_a_file_with_the_token",
        "viewer/test_server.py::test_without_a_place",
        "viewer/test_live.py::test_the_file_that_the_browser_is_given",
    ),
    "every signal that can be caught, those of a background job; another client's lines during an "
    "orphaned run": (
        "cli/test_stop.py::test_every_signal",
        "cli/test_stop.py::test_a_run_in_the_background",
        "controller/test_controller.py::test_a_heartbeat",
        "controller/test_controller.py::test_frames_of_one",
    ),
    "a slow way to the controller, requests that break off, `--for 31d`, 2 million lines": (
        "link/test_latency.py",
        "link/test_flash.py::test_a_controller_that_answers_late",
        "link/test_flash.py::test_answers_that_become_late",
        "viewer/test_server.py::test_a_body_that_breaks_off",
        "cli/test_days.py",
        "language/test_parse.py::test_files_that_are_no_programs",
    ),
    "a full disk under a trace or a recording, signals once and several times, nonsense replies, a "
    "killed host, a deadline": (
        "cli/test_stop.py::test_a_signal_stops",
        "cli/test_stop.py::test_more_signals",
        "cli/test_stop.py::test_a_recording_that_outgrows",
        "cli/test_stop.py::test_a_deadline",
        "cli/test_stop.py::test_a_controller_that_speaks_nonsense",
        "cli/test_stop.py::test_a_killed_host",
        "link/test_stop.py",
    ),
    "an output that is an input, links, modes, pipes, drafts of killed processes, long names, "
    "drawings that fail": (
        "cli/test_outputs.py",
        "test_files.py",
        "cli/test_faults.py",
        "test_power_loss.py",
    ),
    "files of the user in the folder of `mopro blind make`, paths that lead out, a truncated "
    "verdict": ("blind/test_manifest.py",),
    "a pickle in the current folder, a cache of others or with a flipped bit, processes "
    "that fill it at once": ("process/test_cachefolder.py", "plant/kernel/test_cache.py"),
    "clients that flood, say nothing, come second, have no token": ("controller/test_tcp.py",),
    "terminal escapes and changes of direction in names, keys, cells, replies": (
        "cli/test_streams.py",
        "test_text.py",
        "plot/test_figure.py",
    ),
    "deep, long, many: keys, brackets, digits, rows, columns, statements, days": (
        "tomlfile/test_limits.py",
        "tomlfile/test_scan.py",
    ),
    'numbers of machines (`model = "full"` too) and programs from which no finite motion follows, '
    "infinite readings": (
        "machine/test_bounds.py",
        "plant/test_not_finite.py",
        "motion/test_bounds.py",
        "recording/test_foreign_files.py",
        "logs/test_read_log.py",
    ),
    "too little memory": ("process/test_memory.py",),
    "a broken effect package": ("effects/test_packages.py",),
    "editors' messages without or with an absurd length": ("lsp/test_messages.py",),
}


def files_of(attack: str) -> list[str]:
    """The files of the tests of an attack, each once, under `tests/`."""
    return list(dict.fromkeys(name.partition("::")[0] for name in ATTACKS[attack]))
