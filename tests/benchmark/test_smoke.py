"""A dozen hidden-effect cases made, reconciled as real processes and scored."""

import json


def test_a_dozen_hidden_effects(mopro, tmp_path):
    def blind(*args):
        done = mopro("blind", *args)
        assert done.returncode == 0, done.stderr
        return done.stdout

    made = blind("make", "--seed", 1, "--grid", "smoke", "--out", tmp_path)
    assert made.startswith("12 cases")
    cases = json.loads(blind("score", tmp_path, "--json", "--no-follow"))["cases"]
    assert len(cases) == 12
    told = {c["number"]: (c["truth"], c["outcome"], c["said"]) for c in cases}
    assert not [t for t in told.values() if t[1] in ("wrong", "failed")], told
    assert sum(outcome in ("right", "family") for _, outcome, _ in told.values()) >= 11, told
    assert all(c["verdict"] == "none" for c in cases if c["group"] == "none"), told
