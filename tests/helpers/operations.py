"""Values of formulas by the machine of operations, as an integrator carries them out."""

from mopro.formula.bytecode import Assembler, carry_out


def values_by_operations(formulas, values, changes):
    """The value of each formula of `values`, which change as often as `changes` has it."""
    slots = {name: place for place, name in enumerate(values)}
    assembler = Assembler(changes)
    program = assembler.program([assembler.value(formula, slots) for formula in formulas])
    numbers = program.numbers()
    numbers[: len(values)] = list(values.values())
    for first, last in program.segments:
        carry_out(program.operations, first, last, numbers)
    return [float(numbers[place]) for place in program.results]
