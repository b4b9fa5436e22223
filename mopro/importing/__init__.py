"""An experiment from a log: columns, units, noise, command, measurement, each with its reason."""

from mopro.importing.folder import Imported, import_logs
from mopro.importing.propose import Wishes

__all__ = ["Imported", "Wishes", "import_logs"]
