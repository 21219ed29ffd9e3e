"""What may be wrong with a file: each fault is one sentence that names it, and no other error ever comes out."""

from __future__ import annotations

import io
import re
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from recording_cases import columns_of, rig_with, swing, write_columns
from refusals import coded
from swingid.errors import InputError, UnanswerableError
from swingid.recording import Recording
from swingid.recording.formats import matlab

LOG = swing(rate=100.0)
PNG = bytes.fromhex("89504e470d0a1a0a0000000d49484452")


def refused(path, rig=None, kind=InputError):
    """The error of loading `path`, checked to be one sentence that names the file."""
    with pytest.raises(kind) as caught:
        Recording.load(path, rig or rig_with())
    message = caught.value.message
    assert str(path) in message
    assert "\n" not in message
    assert message.endswith(".")
    return caught.value


def loaded_or_refused(path):
    """The recording, or None where an error of exit code 3 or 4 says why not; any other exception passes through."""
    with suppress(InputError, UnanswerableError):
        return Recording.load(path, rig_with())
    return None


def changed(tmp_path, **columns):
    """A CSV of LOG with these columns in the place of its own; a column of None is left out."""
    whole = {**columns_of(LOG), **columns}
    return write_columns(tmp_path / "log.csv", {name: column for name, column in whole.items() if column is not None})


def test_missing_file(tmp_path):
    error = refused(tmp_path / "nothing.csv")
    assert (error.code, error.exit_code) == ("missing-file", 3)


def test_a_folder(tmp_path):
    assert refused(tmp_path).code == "is-a-folder"


@pytest.mark.parametrize("content", [b"", b"\n \n", b"\xef\xbb\xbf", b"# a comment\n"])
@pytest.mark.parametrize("ending", ["csv", "parquet", "mat", "log"])
def test_empty_file(tmp_path, content, ending):
    path = tmp_path / f"empty.{ending}"
    path.write_bytes(content)
    assert refused(path).code in (
        {"empty-file"} if ending in ("csv", "log") or not content.strip() else {"not-a-table"}
    )


def test_header_without_rows(tmp_path):
    path = tmp_path / "header.csv"
    path.write_text("t,q1,q2,u\n")
    error = refused(path)
    assert error.code == "empty-file"
    assert "no rows of numbers" in error.message


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (PNG, "PNG image"),
        (b"\xff\xd8\xff\xe0JFIF", "JPEG image"),
        (b"%PDF-1.7", "PDF"),
        (b"PK\x03\x04workbook", "Excel workbook"),
        (b"  <!DOCTYPE html><html>t,q1</html>", "HTML"),
        (b'{"entries": []}', "JSON"),
        (bytes(range(256)) * 4, "binary data"),
        (b"t,q1\n0,\xff\xfe\xfd\xfc\xfb\xfa", "binary data"),
    ],
)
@pytest.mark.parametrize("name", ["log.csv", "log"])
def test_not_a_table(tmp_path, content, what, name):
    path = tmp_path / name
    path.write_bytes(content)
    error = refused(path)
    assert error.code == "not-a-table"
    assert what in error.message


def test_prose_is_not_a_table(tmp_path):
    path = tmp_path / "notes.txt"
    path.write_text("Dear reader,\nthis is, as you see, no table, but a letter.\n\nIt has lines, and commas.\n")
    assert refused(path).code in ("not-a-table", "missing-column", "empty-file")


def test_missing_column_names_the_nearest_and_the_key(tmp_path):
    error = refused(changed(tmp_path, q1=None, Q1_rad=LOG.angle), rig_with(angle="q1_rad"))
    assert error.code == "missing-column"
    assert "no column 'q1_rad'" in error.message
    assert "'Q1_rad'" in error.message
    assert "[log] angle" in error.message


@pytest.mark.parametrize(
    ("column", "hint"), [("t", r"\[log\] rate"), ("q2", r'another \[drive\] kind than "reaction-wheel"')]
)
def test_missing_time_or_wheel_says_what_else_it_may_be(tmp_path, column, hint):
    assert re.search(hint, refused(changed(tmp_path, **{column: None})).message)


def test_a_log_of_another_drive_is_missing_its_torque(tmp_path):
    error = refused(changed(tmp_path), rig_with("direct", torque="tau"))
    assert "no column 'tau'" in error.message
    assert 'another [drive] kind than "direct"' in error.message


def test_voltage_may_be_missing_unless_the_rig_names_it(tmp_path):
    path = changed(tmp_path, u=None)
    assert Recording.load(path, rig_with()).voltage is None
    assert refused(path, rig_with(voltage="u")).code == "missing-column"


def test_a_reference_that_the_rig_names_may_be_missing(tmp_path):
    loaded = Recording.load(changed(tmp_path, ym=None), rig_with(reference="ym"))
    assert loaded.reference is None
    assert [(finding.code, finding.level) for finding in loaded.findings] == [("no-reference", "note")]
    assert Recording.load(changed(tmp_path, ym=None), rig_with()).findings == ()


def test_a_missing_wheel_speed_is_named(tmp_path):
    with pytest.raises(InputError, check=coded("missing-column", "'w2'", "[log] wheel_speed")):
        Recording.load(changed(tmp_path), rig_with(wheel_speed="w2"))


def test_text_in_a_few_rows_is_dropped_and_told(tmp_path):
    texts = [repr(v) for v in LOG.angle.tolist()]
    texts[100:102] = ["error", "n/a"]
    loaded = Recording.load(changed(tmp_path, q1=texts), rig_with())
    assert np.array_equal(loaded.angle, np.delete(LOG.angle, [100, 101]))
    (finding, gaps) = loaded.findings
    assert (finding.code, finding.level, gaps.code) == ("rows-without-numbers", "note", "gaps")
    assert finding.message.startswith("2 of 500 rows left out: no number in column 'q1' in 2 of 500 rows")
    assert "row 101, such as 'error'" in finding.message


def test_many_rows_without_numbers_warn(tmp_path):
    angle, voltage = LOG.angle.copy(), LOG.voltage.copy()
    angle[10:14], voltage[300:305] = np.nan, np.inf
    loaded = Recording.load(changed(tmp_path, q1=angle, u=voltage), rig_with())
    assert len(loaded) == 491
    assert next(f for f in loaded.findings if f.code == "rows-without-numbers").level == "warning"


def test_a_column_of_text_is_refused(tmp_path):
    texts = [repr(v) if k % 3 == 0 else f"x{k}" for k, v in enumerate(LOG.angle.tolist())]
    error = refused(changed(tmp_path, q1=texts))
    assert error.code == "no-numbers"
    assert "column 'q1' in 333 of 500 rows (the first is row 2, such as 'x1')" in error.message


def test_words_in_the_place_of_seconds_are_refused(tmp_path):
    error = refused(changed(tmp_path, t=["at noon"] * LOG.time.size))
    assert error.code == "no-numbers"
    assert "column 't' holds no numbers but text such as 'at noon'" in error.message


def test_absurd_numbers_are_spikes_without_a_word_of_numpy(tmp_path, recwarn):
    angle = LOG.angle.copy()
    angle[[50, 300]] = 1e200, -1e200
    loaded = Recording.load(changed(tmp_path, q1=angle), rig_with())
    assert np.array_equal(loaded.angle, np.delete(LOG.angle, [50, 300]))
    assert not recwarn.list


def test_a_column_of_nothing_is_refused(tmp_path):
    error = refused(changed(tmp_path, q2=["nan"] * 500))
    assert error.code == "no-numbers"
    assert "'q2'" in error.message


def test_a_gap_in_the_reference_costs_no_row(tmp_path):
    reference = LOG.reference.copy()
    reference[40:60] = np.nan
    loaded = Recording.load(changed(tmp_path, ym=reference), rig_with())
    assert len(loaded) == 500
    assert np.isnan(loaded.reference).sum() == 20
    assert loaded.findings == ()


@pytest.mark.parametrize("rows", [1, 2, 9])
def test_too_few_rows(tmp_path, rows):
    path = write_columns(tmp_path / "log.csv", {n: c[:rows] for n, c in columns_of(LOG).items()})
    error = refused(path, kind=UnanswerableError)
    assert (error.code, error.exit_code) == ("too-short", 4)


def test_a_constant_angle(tmp_path):
    error = refused(changed(tmp_path, q1=np.full(500, 0.3)), kind=UnanswerableError)
    assert error.code == "no-motion"
    assert "'q1'" in error.message


@pytest.mark.parametrize("still", [0, 300])
def test_a_still_wheel_warns(tmp_path, still):
    wheel = np.where(np.arange(500) < still, LOG.wheel_angle, LOG.wheel_angle[still])
    loaded = Recording.load(changed(tmp_path, q2=wheel), rig_with())
    assert [(f.code, f.level) for f in loaded.findings] == [("wheel-still", "warning")]
    assert ("from 3 to 4.99 s" in loaded.findings[0].message) == (still == 300)


@pytest.mark.parametrize(
    ("column", "values", "code"),
    [
        ("q1", 1e300 * LOG.angle, "absurd-number"),
        ("q2", 1e300 * LOG.wheel_angle, "absurd-number"),
        ("u", 1e300 * LOG.voltage, "absurd-number"),
        ("t", 1e300 * LOG.time, "absurd-time"),
        ("t", 1e-300 * LOG.time, "absurd-time"),
        ("t", 1e6 * LOG.time, "absurd-time"),
        ("t", 1e3 * (1.7e9 + LOG.time), "absurd-time"),
    ],
)
def test_numbers_that_no_rig_logs_are_refused(tmp_path, column, values, code):
    error = refused(changed(tmp_path, **{column: values}))
    assert error.code == code
    assert f"'{column}'" in error.message
    assert len(error.message) < 300


def test_seconds_since_1970_are_seconds(tmp_path):
    log = Recording.load(changed(tmp_path, t=1.7e9 + LOG.time), rig_with())
    assert [finding.code for finding in log.findings] == ["from-epoch"]
    np.testing.assert_allclose(log.time, LOG.time - LOG.time[0], atol=2.5e-7)  # the digits that a double has left


@pytest.mark.parametrize("amplitude", [0.4, 0.8, 2.5])
def test_degrees_taken_for_radians(tmp_path, amplitude):
    path = swing(rate=100.0, amplitude=amplitude).save(tmp_path / "x.csv", rig_with(angle_unit="deg"))
    path.write_bytes(path.read_bytes().partition(b"\n")[2])  # without the conventions that swingid wrote
    error = refused(path)
    assert error.code == "implausible-angle"
    assert 'set [log] angle_unit = "deg"' in error.message
    assert len(Recording.load(path, rig_with(angle_unit="deg"))) == 500


def test_many_turns_are_believed_where_they_can_be(tmp_path):
    """A balanced axis; and a free body that spins down over many turns before it swings."""
    wide = changed(tmp_path, q1=57.3 * LOG.angle)
    assert len(Recording.load(wide, rig_with(gravity=0.0))) == 500
    spun = np.concatenate([np.linspace(-80.0, 0.0, 250), 1.2 * np.sin(np.arange(250) / 8)])
    assert len(Recording.load(changed(tmp_path, q1=spun), rig_with("none"))) == 500


def test_milliseconds_taken_for_seconds_warn(tmp_path):
    loaded = Recording.load(changed(tmp_path, t=LOG.time * 1e3), rig_with())
    assert [(f.code, f.level) for f in loaded.findings] == [("slow-rows", "warning")]


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", ", "])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_separators_and_line_ends(tmp_path, separator, newline):
    path = write_columns(tmp_path / "log.txt", columns_of(LOG), separator, newline)
    loaded = Recording.load(path, rig_with())
    assert np.array_equal(loaded.angle, LOG.angle)
    assert np.array_equal(loaded.voltage, LOG.voltage)


def test_decimal_commas(tmp_path):
    columns = {name: [repr(v).replace(".", ",") for v in column.tolist()] for name, column in columns_of(LOG).items()}
    loaded = Recording.load(write_columns(tmp_path / "excel.csv", columns, separator=";"), rig_with())
    assert np.array_equal(loaded.time, LOG.time)
    assert np.array_equal(loaded.angle, LOG.angle)


def test_byte_order_marks_blanks_quotes_and_comments(tmp_path):
    plain = write_columns(tmp_path / "log.csv", columns_of(LOG)).read_text()
    body = plain.partition("\n")[2]
    variants = {
        "utf-8 with mark": ("﻿" + plain).encode(),
        "utf-16": plain.encode("utf-16"),
        "blanks in the header": f" t , q1, q2 ,u \n{body}".encode(),
        "quoted header": f'"t","q1","q2","u"\n{body}'.encode(),
        "comments": f"# rig 3, 2020\n# swing\n{plain}".encode(),
        "header behind #, as numpy.savetxt": f"# {plain}".encode(),
        "no last line end": plain.rstrip("\n").encode(),
        "blank lines": plain.replace("\n", "\n\n").encode(),
        "latin-1": plain.replace("q2,u", "q2,u,Winkel in °", 1)
        .replace("\n", ",0\n")
        .replace("°,0", "°")
        .encode("latin-1"),
    }
    for what, content in variants.items():
        path = tmp_path / "variant.csv"
        path.write_bytes(content)
        loaded = Recording.load(path, rig_with())
        assert np.array_equal(loaded.angle, LOG.angle), what
        assert np.array_equal(loaded.voltage, LOG.voltage), what


def test_two_columns_of_one_name(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,q1,q1,q2\n0,1,2,3\n1,2,3,4\n")
    assert refused(path).code == "double-column"


def test_a_log_cut_off_in_a_line_loses_that_line(tmp_path):
    path = changed(tmp_path)
    path.write_bytes(path.read_bytes()[:-45])
    loaded = Recording.load(path, rig_with())
    assert np.array_equal(loaded.angle, LOG.angle[: len(loaded)])
    assert len(loaded) == 499
    assert [(f.code, f.level) for f in loaded.findings] == [("unreadable-rows", "note")]


def test_lines_that_are_mostly_broken_are_no_table(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,q1,q2,u\n" + "0.1,0.2\n" * 30 + "0.1,0.2,0.3,0.4\n" * 20)
    assert refused(path).code == "not-a-table"


def test_matlab_vectors_structs_and_matrices(tmp_path):
    path = tmp_path / "log.mat"
    angles = np.column_stack([LOG.angle, LOG.wheel_angle])
    savemat(path, {"run": {"t": LOG.time, "u": LOG.voltage[:, None]}, "q": angles, "mass": 3.0, "who": "me"})
    rig = rig_with(time="run.t", voltage="run.u", angle="q(:,1)", wheel_angle="q(:,2)")
    loaded = Recording.load(path, rig)
    assert np.array_equal(loaded.wheel_angle, LOG.wheel_angle)
    assert np.array_equal(loaded.voltage, LOG.voltage)
    assert "it has" not in refused(path).message
    assert "'run.t'" in refused(path).message


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("kind", ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"])
@pytest.mark.parametrize("long", [500, 3])
def test_matlab_numbers_of_every_type(kind, compressed, long):
    """Against the numbers given to SciPy's writer, also in elements of up to four bytes, which are stored otherwise."""
    column, matrix = np.arange(long).astype(kind), np.arange(2 * long).reshape(long, 2).astype(kind)
    stream = io.BytesIO()
    variables = {"v": column, "tall": matrix, "wide": matrix.T, "c": {"a": {"b": column}}, "z": 1j * column}
    savemat(stream, {**variables, "text": "abc", "cell": np.array([{}, 1], dtype=object)}, do_compression=compressed)
    table = matlab.read(stream.getvalue(), "x.mat")
    expected = {"v": column, "c.a.b": column, "tall(:,1)": matrix[:, 0], "tall(:,2)": matrix[:, 1]}
    expected |= {"wide(1,:)": matrix[:, 0], "wide(2,:)": matrix[:, 1]}
    assert set(table.columns) == set(expected)
    assert all(np.array_equal(table.columns[key], values) for key, values in expected.items())


def test_matlab_columns_of_unequal_length(tmp_path):
    path = tmp_path / "log.mat"
    savemat(path, {"t": LOG.time, "q1": LOG.angle[:-3], "q2": LOG.wheel_angle})
    error = refused(path)
    assert error.code == "unequal-length"
    assert "'t' has 500 values but 'q1' has 497" in error.message


@pytest.mark.parametrize(
    ("content", "code", "what"),
    [
        (b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n", "not-a-table", "not a whole HDF5 file"),
        (b"t,q1\n0,1\n", "not-a-table", "not a MATLAB v5 file"),
        (b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b"\x07" * 90, "not-a-table", "damaged"),
    ],
)
def test_matlab_files_that_cannot_be_read(tmp_path, content, code, what):
    path = tmp_path / "log.mat"
    path.write_bytes(content)
    error = refused(path)
    assert error.code == code
    assert what in error.message


def test_a_matlab_file_of_scalars_only(tmp_path):
    path = tmp_path / "log.mat"
    savemat(path, {"a": 1.0, "b": "text"})
    assert "no vectors of numbers" in refused(path).message


def _whole_files():
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        files = {e: LOG.save(Path(folder) / f"x.{e}").read_bytes() for e in ("csv", "parquet")}
    stream = io.BytesIO()
    savemat(stream, {"t": LOG.time, "q1": LOG.angle, "q2": LOG.wheel_angle, "u": LOG.voltage})
    return {**files, "mat": stream.getvalue()}


WHOLE = _whole_files()


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ending=st.sampled_from(sorted(WHOLE)), cut=st.floats(0.0, 1.0), extra=st.binary(max_size=8))
@example(ending="mat", cut=0.9, extra=b"")
@example(ending="parquet", cut=0.999, extra=b"")
def test_a_file_cut_off_anywhere_is_read_or_refused(tmp_path, ending, cut, extra):
    content = WHOLE[ending]
    path = tmp_path / f"cut.{ending}"
    path.write_bytes(content[: round(cut * len(content))] + extra)
    loaded = loaded_or_refused(path)
    assert loaded is None or np.isin(loaded.time[:-1], LOG.time).all()


@settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    content=st.one_of(
        st.binary(min_size=1, max_size=300),
        st.binary(max_size=200).map(lambda b: b"PAR1" + b + b"PAR1"),
        st.binary(max_size=200).map(lambda b: b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b),
        st.text(alphabet='t,q12u;"\n\r#. 0-eE\t', max_size=200).map(lambda s: ("t,q1,q2,u\n" + s).encode()),
        st.text(max_size=200).map(lambda s: ("# swingid: " + s).encode()),
    ),
    ending=st.sampled_from(["csv", "parquet", "mat", "txt", "bin", ""]),
)
def test_garbage_is_refused(tmp_path, content, ending):
    path = tmp_path / f"garbage.{ending}"
    path.write_bytes(content)
    assert loaded_or_refused(path) is None


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), ending=st.sampled_from(sorted(WHOLE)))
def test_flipped_bytes_never_end_in_a_traceback(tmp_path, data, ending):
    content = bytearray(WHOLE[ending])
    for _ in range(data.draw(st.integers(1, 6))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / f"flipped.{ending}"
    path.write_bytes(bytes(content))
    loaded_or_refused(path)


def test_a_clock_that_jumps_far_is_refused(tmp_path):
    """Two runs of which the clock was set between them; a pause of some times the run is a gap like any other."""
    columns = columns_of(swing(rate=100.0, duration=10.0))
    for pause, refused in ((60.0, False), (1e6, True)):
        late = {name: values.copy() for name, values in columns.items()}
        late["t"][500:] += pause
        path = write_columns(tmp_path / "log.csv", late)
        if refused:
            with pytest.raises(InputError, check=coded("absurd-time", "1e+06 s", "500")):
                Recording.load(path, rig_with())
        else:
            assert "gaps" in {finding.code for finding in Recording.load(path, rig_with()).findings}
