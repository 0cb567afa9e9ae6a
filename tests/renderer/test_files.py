"""Files at the rim: whole or not at all, errors of one line, stable hashes."""

from __future__ import annotations

import hashlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from renderer.files import (
    InputError,
    atomic_path,
    file_sha256,
    read_json,
    value_sha256,
    write_json,
)

json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


def test_an_error_is_one_short_line_however_long_the_value():
    error = InputError("a.json", "clips[0]", "x\n" * 500, "less")
    assert "\n" not in str(error) and len(str(error)) < 200
    assert (error.source, error.field, error.wanted) == ("a.json", "clips[0]", "less")


def test_an_interrupted_write_leaves_the_old_file_and_nothing_else(tmp_path):
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(KeyboardInterrupt), atomic_path(target) as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert target.read_text() == "old" and list(tmp_path.iterdir()) == [target]


def test_a_finished_write_replaces_the_file_and_keeps_the_suffix(tmp_path):
    target = tmp_path / "new" / "a.mp4"
    with atomic_path(target) as temporary:
        assert temporary.suffix == ".mp4" and temporary.parent == target.parent
        temporary.write_bytes(b"whole")
    assert target.read_bytes() == b"whole" and list(target.parent.iterdir()) == [target]


@given(value=json_values)
def test_json_comes_back_as_it_was(tmp_path_factory, value):
    target = tmp_path_factory.mktemp("json") / "a.json"
    write_json(target, value)
    assert read_json(target) == value


def test_a_number_that_is_no_number_is_not_written(tmp_path):
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "a.json", {"score": float("nan")})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b"[1,]"])
def test_broken_json_is_named(tmp_path, content):
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"a\.json: content"):
        read_json(path)
    with pytest.raises(InputError, match=r"b\.json: file: got 'missing'"):
        read_json(tmp_path / "b.json")


def test_hashes_are_those_of_the_bytes_and_of_canonical_json(tmp_path):
    content = b"0123456789" * 300_000
    (tmp_path / "a").write_bytes(content)
    assert file_sha256(tmp_path / "a") == hashlib.sha256(content).hexdigest()
    assert value_sha256({"b": 1, "a": [2]}) == value_sha256({"a": [2], "b": 1})
    assert value_sha256({"a": 1}) == hashlib.sha256(b'{"a":1}').hexdigest()


def test_keys_are_written_in_order(tmp_path):
    write_json(tmp_path / "a.json", {"b": 1, "a": 2})
    assert list(json.loads((tmp_path / "a.json").read_text())) == ["a", "b"]
