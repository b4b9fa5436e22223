"""The consequences of a verdict: machine file, gap, places and wording."""
