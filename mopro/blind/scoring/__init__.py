"""Verdicts asked for and judged, and the statistics of all judgements."""
