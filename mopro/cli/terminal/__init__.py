"""Shared parts of commands: streams, tables, progress, options, outputs, completion."""
