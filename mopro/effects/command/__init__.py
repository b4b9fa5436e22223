"""The controller: its command before the drive sees it."""
