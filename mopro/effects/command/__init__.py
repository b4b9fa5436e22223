"""Effects on the controller's command, before the drive."""
