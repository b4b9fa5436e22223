"""Logs of small machines as people write them, and what each must be read as."""
