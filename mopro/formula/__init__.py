"""Formulas that people write in files: parsed, checked by dimension, evaluated; never executed."""

from mopro.formula.dimension import (
    Dimension,
    UnitError,
    dimension_of_unit,
    factor_of,
    inverse,
    product,
)
from mopro.formula.expressions import Formula, FormulaError, parse

__all__ = [
    "Dimension",
    "Formula",
    "FormulaError",
    "UnitError",
    "dimension_of_unit",
    "factor_of",
    "inverse",
    "parse",
    "product",
]
