"""Commands on machine files and the source's tables: machine, limits, thesis."""
