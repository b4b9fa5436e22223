"""The heat balance of chapter 3.1: its missing terms."""
