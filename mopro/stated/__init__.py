"""Machines of other kinds than the motor: axes, thermal nodes, and whatever follows its command."""
