"""Parsers of columns of numbers: recordings, logs, raw files; caches and manifests."""

from __future__ import annotations

import base64
import io
import json
import shutil
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

from helpers.fuzzing.parser import Parser, Take, files, in_file

_CSV = (
    "time_s",
    ",",
    ";",
    "\t",
    "|",
    " ",
    "\n",
    "\r\n",
    "\r",
    "nan",
    "inf",
    "-inf",
    "1e309",
    "0x1",
    "2026-01-02T03:04:05",
    "23:59:59.9",
    "Z",
    "+01:00",
    "1.234.567,8",
    "22.11.2026",
    "11/22/26",
    "Nov 22, 2026",
    "PM",
    "9.9E37",
    "[0.1, 2]",
    "<Run|MPos:1,2|FS:5>",
    "65535",
    "Time",
    "nsec",
    "***End_of_Header***",
    '"',
    "# mopro {}",
    "[mm]",
    "\x1a",
    "\0",
    "\xff\xfe",
    "99999999999999999999",
    "-",
    "position_1_mm",
    "(s)",
    "_C",
    "\u2028",
)
_JSON = (
    '{"',
    '": ',
    "[",
    "]",
    "{",
    "}",
    "null",
    "true",
    "NaN",
    "Infinity",
    "1e999",
    '"run"',
    '"moves"',
    '"program"',
    '"\\ud800"',
    "99999999999999999999",
    '"stalls"',
    '"trip"',
    '"files"',
    '"cases"',
)
_RECORDINGS = ("mopro.recording.reading", "mopro.recording.run")
_LOGS = ("mopro.logs",)


# -- recordings --------------------------------------------------------------------


def _recording(suffix: str) -> object:
    def make(folder: Path) -> Take:
        from mopro.recording import read
        from mopro.recording.reading import is_recording

        def both(path: Path) -> None:
            is_recording(path)
            recording = read(path)
            recording._repr_html_()

        return in_file(folder, f"fuzz{suffix}", both)

    return make


def _header(folder: Path) -> Take:
    take = _recording(".csv")(folder)
    return lambda data: take(b"# mopro " + data.replace(b"\n", b" ") + b"\ntime_s,line\n0.0,1\n")


def _arrow(folder: Path) -> Take:
    """The metadata of a Parquet file: mopro's own header, or the schema that Arrow keeps."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from mopro.logs import read_log
    from mopro.recording import read

    path = folder / "fuzz.parquet"
    schema = pa.schema([("time_s", pa.float64()), ("x_mm", pa.float64())])
    rows = pa.table({"time_s": [0.0, 1.0], "x_mm": [0.0, 2.0]}, schema)

    def take(data: bytes) -> None:
        own = data[:1] != b"\x01"
        metadata = {b"mopro": data} if own else {b"ARROW:schema": base64.b64encode(data[1:])}
        with pq.ParquetWriter(path, schema, store_schema=False) as writer:
            writer.write_table(rows)
            writer.add_key_value_metadata(metadata)
        (read if own else read_log)(path)

    return take


def _array(folder: Path) -> Take:
    """An array of an NPZ archive, whose own checksums are right."""
    from mopro.logs import read_log
    from mopro.recording import read

    path = folder / "fuzz.npz"
    head = json.dumps(_HEADER).encode()

    def take(data: bytes) -> None:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("time_s.npy", data)
            archive.writestr("mopro.npy", _npy(head))
        (read if data[-1:] < b"\x80" else read_log)(path)

    return take


def _npy(data: bytes) -> bytes:
    import numpy as np

    file = io.BytesIO()
    np.save(file, np.frombuffer(data, np.uint8))
    return file.getvalue()


_HEADER = {
    "program": "P.CMD",
    "program_sha256": "0" * 64,
    "machine": "chow1992",
    "back_end": "emulator",
    "rate_hz": 100.0,
    "payload_kg": 0.0,
    "seed": 0,
    "versions": {"mopro": "0.1.0"},
}


def _written(suffix: str) -> list[bytes]:
    """A recording as mopro writes it."""
    import mopro
    from mopro.recording import open_sink

    program = mopro.compile("UU012500/1\nVEL1 8.0\nACC1 0.25\nMRI1 0.1\nWX1\n")
    recording = mopro.emulate(program, rate_hz=50.0)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        with open_sink(path, recording.header) as sink:
            sink.write({n: v[:20] for n, v in list(recording.columns.items())[:3]})
            sink.run = recording.run
        return [path.read_bytes()]


def _headers() -> list[bytes]:
    from mopro.recording.reading import CSV_MARK

    own = _written(".csv")[0].splitlines()[0].removeprefix(CSV_MARK.encode())
    return [own, json.dumps(_HEADER).encode()]


def _schemas() -> list[bytes]:
    import pyarrow as pa

    schema = pa.schema([("time_s", pa.float64()), ("x_mm", pa.float64())])
    return [b"\x01" + schema.serialize().to_pybytes(), *_headers()]


# -- logs --------------------------------------------------------------------------


def _log(suffix: str) -> object:
    def make(folder: Path) -> Take:
        from mopro.logs import read_log

        return in_file(folder, f"fuzz{suffix}", read_log)

    return make


def _imported(folder: Path) -> Take:
    from mopro.importing import Wishes, import_logs

    out = folder / "out"

    def read(path: Path) -> None:
        shutil.rmtree(out, ignore_errors=True)
        import_logs([path], out, Wishes())

    return in_file(folder, "fuzz.csv", read)


def _message(folder: Path) -> Take:
    """A message of an MCAP file that is whole."""
    from mcap.writer import CompressionType, Writer

    from mopro.logs import read_log

    path = folder / "fuzz.mcap"

    def take(data: bytes) -> None:
        with open(path, "wb") as file:
            writer = Writer(file, compression=CompressionType.NONE)
            writer.start()
            schema = writer.register_schema("s", "jsonschema", b"{}")
            channel = writer.register_channel("/x", "json", schema)
            for n, part in enumerate(data.split(b"\n")):
                writer.add_message(channel, n, part, n)
            writer.finish()
        read_log(path)

    return take


def _mcaps() -> list[bytes]:
    with TemporaryDirectory() as folder:
        _message(Path(folder))(b'{"a": 1, "b": [2, 3]}\n{"a": 2, "b": [4, 5]}')
        return [(Path(folder) / "fuzz.mcap").read_bytes()]


def _parquets() -> list[bytes]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables = [
        pa.table({"time_s": [0.0, 0.1, 0.2], "x_mm": [1.0, None, 3.0], "word": ["a", "b", None]}),
        pa.table({"stamp": pa.array([1, 2, 3], pa.timestamp("us", "UTC")), "T_C": [1, 2, 3]}),
        pa.table({"time": ["00:00:01", "00:00:02"], "deep": [{"a": [1]}, {"a": []}]}),
    ]
    made = []
    for table in tables:
        file = io.BytesIO()
        pq.write_table(table, file)
        made.append(file.getvalue())
    return made


def _npzs() -> list[bytes]:
    import numpy as np

    made = []
    for arrays in ({"time_s": np.arange(3.0), "x_mm": np.arange(3)}, {"t": np.zeros((2, 2))}):
        file = io.BytesIO()
        np.savez(file, **arrays)
        made.append(file.getvalue())
    return made


def _npys() -> list[bytes]:
    import numpy as np

    made = []
    for array in (np.arange(3.0), np.arange(3, dtype=np.int8), np.zeros((1, 2)), np.array("word")):
        file = io.BytesIO()
        np.save(file, array)
        made.append(file.getvalue())
    return made


def _hdf5s() -> list[bytes]:
    import h5py
    import numpy as np

    file = io.BytesIO()
    with h5py.File(file, "w") as made:
        made["time_s"] = np.arange(3.0)
        made["a/x"] = np.arange(3)
        made["a/x"].attrs["unit"] = "mm"
    return [file.getvalue()]


_LOGGED = [
    b"time_s,x_mm,T_C\n0,1,20\n0.1,2,21\n0.2,3,22\n0.3,4,23\n",
    b"# logger 3\nTime;Position;Force\n[s];[mm];[N]\n0,0;1,5;2\n0,1;1,6;3\n0,2;1,7;2\n",
    b"stamp\tvalue\n2026-01-02T03:04:05.5Z\t1\n2026-01-02T03:04:06.5Z\t2\n",
    b"time x\n23:59:59 1\n0:00:00 2\n0:00:01 3\n",
    b"t_ns,x\n1700000000000000000,1\n1700000000001000000,2\n",
    b"time_s,x_mm\n" + b"".join(b"%d,%d\n" % (n % 9, n % 7) for n in range(27)),
    b"t_ms,x\n65516,1\n65526,2\n0,3\n10,4\n20,5\n",
    b"t,x\n0,1\n0,2\n0,3\n1,1\n1,2\n1,5\n2,2\n2,3\n2,1\n",
    b"sec,nsec,x\n7,900000000,1\n8,0,2\n8,100000000,3\n8,500000000,2\n9,0,1\n",
    b"Date;Uhrzeit;x\n22.11.2026;10:00:00,5;1\n22.11.2026;10:00:01,5;2\n25.11.2026;9:00:00;3\n",
    b"time,x\n11/22/2026 11:59:59 AM,1\n11/22/2026 12:00:00 PM,2\n11/22/2026 12:00:02 PM,3\n",
    b"when,x\n2026-10-25T02:59:59+02:00,1\n2026-10-25T02:00:00+01:00,2\n2026-10-25T02:00:01Z,3\n",
    b'time_s,q\n0,"[0.1, 2]"\n1,"[0.2, 3]"\n2,"[0.3, nan]"\n',
    b"# note\ntime_s,x_mm,\n0,1,\nINFO: a note\n1,9.9E37,\n2,1,late\ntime_s,x_mm,\n0,2,\n1,3,\n",
    b"ok\n[10:00:00.1] <Run|MPos:1,2,3|FS:5,0>\n[10:00:00.2] <Idle|MPos:1,2,4|FS:5,0>\n",
    b"Delta_X\t0.1\t0.1\nX_Value\tV0\tComment\n0\t1\n0.1\t2\n0.2\t3\n",
    "time_s;x\r\n0;1,5\r\n1;2,5\r\n".encode("utf-16"),
]


# -- data, raw files, caches, manifests --------------------------------------------


def _data(folder: Path) -> Take:
    from mopro.experiment.data_file import read_data

    wanted = {"time_s", "position_1_mm", "temperature_C"}

    def read(path: Path) -> None:
        file = read_data(path, "fuzz.csv", wanted)
        file.require("time_s")

    return in_file(folder, "fuzz.csv", read)


def _raw(folder: Path) -> Take:
    from mopro.instruments import read_lvdt, read_thermocouple

    def read(path: Path) -> None:
        if path.read_bytes()[:1] == b"-":
            read_lvdt(path, samples=None)
        read_thermocouple(path)

    return in_file(folder, "fuzz.DAT", read)


def _cache(folder: Path) -> Take:
    from mopro.plant.kernel.cache import KernelCache
    from mopro.process.cachefolder import read_kept, with_digest

    path = folder / "fuzz.cache"
    kernels = KernelCache(path, "key")

    def take(data: bytes) -> None:
        path.write_bytes(with_digest(data) if data[:1] == b"\x01" else data)
        kept = read_kept(path)
        if kept is not None and with_digest(kept) != path.read_bytes():
            raise AssertionError("a damaged cache was believed")
        path.write_bytes(data)
        if kernels.load_overload(None, None) is not None:
            raise AssertionError("a damaged kernel was believed")

    return take


def _manifest(folder: Path) -> Take:
    from mopro.blind.cases.manifest import Manifest

    return in_file(
        folder, "made.json", lambda path: Manifest.read(path.parent).refuse_foreign(["1"])
    )


def _answers(folder: Path) -> Take:
    from mopro.blind.scoring.scored_cases import CaseFolder

    return in_file(folder, "answers.json", lambda path: CaseFolder.read(path.parent).files)


def _verdict(folder: Path) -> Take:
    from mopro.blind.scoring.verdict_source import _read_kept

    return in_file(folder, "verdict.json", _read_kept)


_FORM = "files that mopro blind made, with their SHA-256"
_MANIFEST = json.dumps({_FORM: {"001/experiment.toml": "0" * 64, "answers.json": "1" * 64}})
_ANSWER = {
    "files": {},
    "group": "x",
    "sensor": "laser",
    "effects": [],
    "offsets": {},
    "instruments": [],
    "strange": False,
}
_ANSWERS = json.dumps({"seed": 1, "grid": "small", "cases": {"001": _ANSWER}})
_VERDICT = {
    "verdict": "found",
    "effects": [{"name": "dahl"}],
    "files": {},
    "seconds": 1.0,
    "exit_code": 0,
    "stderr": "",
}
_RAW = [b" 1.5 \r\n-2.25 \r\n .5 \r\n\x1a", b"-1\n-2\n", b" 20.5  0 \r\n 21  15 \r\n"]

TABLES = (
    Parser(
        "recording, CSV", _RECORDINGS, _recording(".csv"), lambda: _written(".csv"), _CSV, 2, 4096
    ),
    Parser(
        "recording, Parquet",
        _RECORDINGS,
        _recording(".parquet"),
        lambda: _written(".parquet"),
        (),
        1,
        16384,
    ),
    Parser(
        "recording, NPZ", _RECORDINGS, _recording(".npz"), lambda: _written(".npz"), (), 2, 8192
    ),
    Parser("recording's header", _RECORDINGS, _header, _headers, _JSON, 3, 4096),
    Parser("Arrow metadata", _RECORDINGS, _arrow, _schemas, _JSON, 1),
    Parser(
        "array of an NPZ",
        ("mopro.recording.reading", "mopro.logs.containers"),
        _array,
        _npys,
        ("descr", "<f8", "|O", "fortran_order", "shape", "(99999999999,)", "True"),
        2,
        512,
    ),
    Parser("log, text", _LOGS, _log(".txt"), lambda: _LOGGED, _CSV, 1, 512),
    Parser("log, Parquet", _LOGS, _log(".parquet"), _parquets, (), 1, 8192),
    Parser("log, NPZ", _LOGS, _log(".npz"), _npzs, (), 1),
    Parser("log, HDF5", _LOGS, _log(".h5"), _hdf5s, (), 1, 16384, 500),
    Parser("log, MCAP", _LOGS, _log(".mcap"), _mcaps, (), 1),
    Parser(
        "message of an MCAP",
        _LOGS,
        _message,
        lambda: [b'{"a": 1, "b": [2]}\n{"a": 2}'],
        _JSON,
        1,
        512,
    ),
    Parser("log, imported", ("mopro.importing",), _imported, lambda: _LOGGED, _CSV, 1, 512),
    Parser(
        "data of an experiment",
        ("mopro.experiment.data_file",),
        _data,
        lambda: [
            b"time_s,position_1_mm,temperature_C\n0,1,20\n0.1,,21\n",
            *files("programs/thermal/*.csv"),
        ],
        _CSV,
        6,
        512,
    ),
    Parser(
        "raw file of an instrument",
        ("mopro.instruments.laboratory",),
        _raw,
        lambda: _RAW,
        _CSV,
        6,
        512,
    ),
    Parser(
        "caches",
        ("mopro.process.cachefolder",),
        _cache,
        lambda: [b"\x01content", bytes(80)],
        (),
        6,
        256,
    ),
    Parser(
        "manifest",
        ("mopro.blind.cases.manifest",),
        _manifest,
        lambda: [_MANIFEST.encode()],
        (*_JSON, _FORM, "../", "001/a.csv"),
        6,
        512,
    ),
    Parser(
        "answers of a benchmark",
        ("mopro.blind.scoring.scored_cases",),
        _answers,
        lambda: [_ANSWERS.encode()],
        (*_JSON, '"seed"', '"001"', "../"),
        4,
        512,
    ),
    Parser(
        "kept verdict",
        ("mopro.blind.scoring.verdict_source",),
        _verdict,
        lambda: [json.dumps(_VERDICT).encode()],
        _JSON,
        4,
        512,
    ),
)
