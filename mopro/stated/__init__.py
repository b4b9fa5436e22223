"""Machines whose equations a file states: axes, thermal nodes, and whatever follows its command."""
