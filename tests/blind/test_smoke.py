"""A dozen hidden-effect cases made, reconciled and scored; one of them as a real process."""

import json

# Nothing is hidden in it: the quickest.
AS_A_PROCESS = "008"


def test_a_dozen_hidden_effects(mopro, tmp_path):
    def answered(*args, codes=(0,)):
        done = mopro(*args)
        assert done.returncode in codes, done.stderr
        return done.stdout

    made = answered("blind", "make", "--seed", 1, "--grid", "smoke", "--out", tmp_path / "cases")
    assert made.startswith("12 cases")
    replies = tmp_path / "replies"
    replies.mkdir()
    for number in (f"{i:03}" for i in range(1, 13)):
        experiment = tmp_path / "cases" / number / "experiment.toml"
        reply = answered("reconcile", experiment, "--json", codes=(0, 1))
        (replies / f"{number}.json").write_text(reply)
    score = ("blind", "score", tmp_path / "cases", "--json", "--no-follow")
    cases = json.loads(answered(*score, "--answers-from", replies))["cases"]
    assert len(cases) == 12
    told = {c["number"]: (c["truth"], c["outcome"], c["said"]) for c in cases}
    assert not [t for t in told.values() if t[1] in ("wrong", "failed")], told
    assert sum(outcome in ("right", "family") for _, outcome, _ in told.values()) >= 11, told
    assert all(c["verdict"] == "none" for c in cases if c["group"] == "none"), told
    (alone,) = json.loads(answered(*score, "--cases", AS_A_PROCESS))["cases"]
    (within,) = (case for case in cases if case["number"] == AS_A_PROCESS)
    assert {**alone, "seconds": None} == {**within, "seconds": None}
