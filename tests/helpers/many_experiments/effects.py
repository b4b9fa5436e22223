"""Effects of the user as formulas: of each name, at each place, with ranges of all sizes."""

# Terms of a variable `z`: `c` is in the unit of what is added to, `Z` and `W` in that of z. Those
# beyond the bar leave the numbers for a part of the range of z, and end many an experiment.
TERMS = (
    "c * z / Z", "c * abs(z / Z)", "c * (z / Z)**2", "c * (z / Z)**3", "c * sqrt(abs(z / Z))",
    "c * log(1 + (z / Z)**2)", "c * exp(-(z / Z)**2)", "c * tanh(z / Z)", "c * sign(z - Z)",
    "c * sin(2 * pi * z / P)", "c * sin(2*pi*z/P) + s * cos(2*pi*z/P)", "c * (z > Z)",
    "c * max(z - Z, 0) / W", "c * atan2(z, Z)", "c * (1 if z > Z else -1)", "c",
    "c * z / (abs(z) + Z)", "c * abs(z / Z)**n", "c * (z / Z - 1)**2 / (1 + (z / Z)**4)",
    "c * min(z, Z) / W",
)  # fmt: skip
WILD = (
    "c * sqrt(z / Z)", "c * log(z / Z)", "c * Z / z", "c * exp(z / Z)", "c * sinh(z / Z)",
    "c * asin(z / Z)", "c * tan(z / Z)", "c / (1 - z / Z)", "c * (z / Z)**n", "c * exp(exp(z / Z))",
    "c * log(1 - (z / Z)**2)", "c * acos(z / Z)", "c * (z / Z)**9",
)  # fmt: skip
OF_SIGNALS = (
    "c * lag(z, tau) / Z", "c * rate(z) * tau / Z", "c * (z - first(z)) / Z", "c * side(z)",
    "c * before(z) / Z", "c * since_change(z) / tau", "c * delayed(z, tau) / Z",
    "c * play(z, w) / Z", "c * presliding(z, Z)", "c * swing(z, f, zeta) / Z", "c * side(z, share)",
    "c * (play(z, w, h) - z) / Z",
)  # fmt: skip
IN_EQUATIONS = ("force", "friction", "power")


def effect(draw, name, enters, unit, names, wild=0.1):
    """The keys of an `[[effect]]` at a place; `names` are those that it may use, with units.

    `unit`: of what is added to. `wild`: how often a term may leave the finite numbers.
    """
    of = draw.pick(*names)
    terms = TERMS
    if draw.chance(wild):
        terms = WILD
    elif enters.split()[0] not in (*IN_EQUATIONS, "ambient") and draw.chance(0.3):
        terms = OF_SIGNALS
    term = draw.pick(*terms)
    keys = {"name": name, "enters": enters, "formula": _with(term, of)}
    units = {
        "c": unit, "s": unit, "Z": names[of], "W": names[of], "P": names[of], "w": names[of],
        "n": "1", "tau": "s", "f": "Hz", "zeta": "1", "share": "1", "h": "1",
    }  # fmt: skip
    for parameter, own in units.items():
        if _with(term, of) != _with(term, of, {parameter}):
            keys[parameter] = _parameter(draw, parameter, own)
    return keys


def _with(term, of, renamed=()):
    """The term with the variable in the place of z; `renamed` parameters get another name."""
    words, word = [], ""
    for letter in term + " ":
        if letter.isalnum() or letter == "_":
            word += letter
            continue
        words += [of if word == "z" else f"{word}_" if word in renamed else word, letter]
        word = ""
    return "".join(words).strip()


FIXED = {
    "n": [0.2, 4.0], "tau": ["step", "length / 3"], "f": ["1 / length", "1 / step"],
    "zeta": [0.01, 0.9], "share": [0.01, 0.5], "h": [-1.0, 1.0],
}  # fmt: skip


def _parameter(draw, name, unit):
    keys = {"unit": unit}
    if name in FIXED:
        return {**keys, "range": FIXED[name], "role": "shape"}
    low = draw.size(-12, 9)
    spans = ([low, low * draw.size(0.1, 6)], [-low, low], [0.0, low], [-low * 1e3, -low])
    if name in ("c", "s"):
        if draw.chance(0.35):
            keys["range"] = draw.pick(*spans[:3])
            if draw.chance(0.3):
                keys["start"] = keys["range"][1] * 0.3
        elif draw.chance(0.3):
            keys["positive"] = True
        return keys
    if name == "P":
        keys["role"] = "period"
    elif draw.chance(0.6) or name in ("Z", "W", "w"):
        keys["role"] = "shape" if draw.chance(0.8) else "threshold"
    if draw.chance(0.35):
        keys["range"] = spans[0]
    return keys
