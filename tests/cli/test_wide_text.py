"""Commands on programs and data in UTF-16, as editors and shells of Windows save them."""

import json

import pytest

PROGRAM = "UU012500/1\r\nVEL1  8.0\r\nACC1 0.25\r\nMRI1 2.0 ; caf\u00e9\r\nWX1\r\n"
ENCODINGS = ["utf-16", "utf-16-le", "utf-16-be"]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_program_is_linted_compiled_and_run(mopro, tmp_path, encoding):
    (tmp_path / "P.CMD").write_bytes(PROGRAM.encode(encoding))
    assert mopro("lint", "P.CMD").returncode == 0
    assert mopro("compile", "P.CMD").returncode == 0
    done = mopro("run", "P.CMD", "--emulate", "--json", "--out", "x.csv")
    assert [move["line"] for move in json.loads(done.stdout)["moves"]] == [4]


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("end", ["", "\x1a", "\x1a\u1a1a old"])
def test_a_program_is_formatted_in_its_own_encoding(mopro, tmp_path, encoding, end):
    (tmp_path / "P.CMD").write_bytes((PROGRAM + end).encode(encoding))
    assert mopro("fmt", "P.CMD").returncode == 0
    tidy = (tmp_path / "P.CMD").read_bytes()
    assert tidy.decode(encoding) == PROGRAM.replace("VEL1  8", "VEL1 8").replace(" ;", "  ;") + end
    assert tidy[:2] == (PROGRAM.encode(encoding))[:2]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_data_are_compared_as_import_read_them(mopro, tmp_path, encoding):
    rows = "".join(f"{n / 10},{n % 9},{n % 9 + 0.01 * (n % 3)}\n" for n in range(200))
    (tmp_path / "log.csv").write_text("time_s,command_mm,position_mm\n" + rows)
    assert mopro("import", "log.csv", "--as", "out").returncode == 0
    before = mopro("compare", "out/experiment.toml", "--json")
    data = tmp_path / "out" / "data.csv"
    data.write_bytes(data.read_text().encode(encoding))
    after = mopro("compare", "out/experiment.toml", "--json")
    assert (before.returncode, before.stdout) == (after.returncode, after.stdout)
    assert before.returncode in (0, 1)
