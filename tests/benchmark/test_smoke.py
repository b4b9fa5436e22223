"""Hidden-effect cases made, reconciled as real processes and scored."""

import json

# Of a grid of twelve: one of heat, one of the encoder, a pair, none and one off the catalogue.
CASES = "001,004,005,006,008,010"


def test_hidden_effects_are_named_and_nothing_else(mopro, tmp_path):
    def blind(*args):
        done = mopro("blind", *args)
        assert done.returncode == 0, done.stderr
        return done.stdout

    made = blind("make", "--seed", 1, "--grid", "smoke", "--cases", CASES, "--out", tmp_path)
    assert made.startswith("6 cases")
    cases = json.loads(blind("score", tmp_path, "--json", "--no-follow"))["cases"]
    assert len(cases) == 6
    told = {c["number"]: (c["truth"], c["outcome"], c["said"]) for c in cases}
    assert not [t for t in told.values() if t[1] in ("wrong", "failed")], told
    assert sum(outcome in ("right", "family") for _, outcome, _ in told.values()) >= 5, told
    assert {c["group"] for c in cases} == {"single", "pair", "none", "off catalogue"}
    assert all(c["verdict"] == "none" for c in cases if c["group"] == "none"), told
