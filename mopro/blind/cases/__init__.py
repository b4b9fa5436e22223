"""Effects that can be hidden, and the specification of a case."""
