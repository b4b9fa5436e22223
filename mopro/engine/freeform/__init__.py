"""Free-form terms of the measurement: functions of time and motion that no catalogue lists.

Each is added to the predictions of one sensor, in all its runs or in one. They stand beside
the catalogue at a price of their own, and describe what is left where no listed effect does.
"""

from mopro.engine.freeform.terms import measurement_laws
from mopro.engine.freeform.with_laws import WithLaws

__all__ = ["WithLaws", "measurement_laws"]
