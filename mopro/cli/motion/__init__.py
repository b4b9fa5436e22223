"""Commands that run programs on a machine, emulated or real: run, serve, flash and ports."""
