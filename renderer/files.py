"""Files at the rim: the one-line error of every reader, atomic writing, content hashes.

Standard library only, so that every package may use it.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


class InputError(ValueError):
    """Bad input from outside. Its text is one line: what file, which field, which value, what was wanted.

    Command lines print it as it is and exit with status 1; web views turn it into a proper page.
    """

    def __init__(self, source: object, field: str, value: object, wanted: str) -> None:
        shown = repr(value)
        shown = shown if len(shown) <= 120 else shown[:117] + "..."
        super().__init__(f"{source}: {field}: got {shown}, wanted {wanted}".replace("\n", " "))
        self.source, self.field, self.value, self.wanted = str(source), field, value, wanted

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, object, str]]:
        # Exceptions cross process borders by their arguments, and ours are not the text.
        plain = isinstance(self.value, str | int | float | None)
        value = self.value if plain else str(self.value)
        return InputError, (self.source, self.field, value, self.wanted)


@contextmanager
def atomic_path(target: Path) -> Iterator[Path]:
    """Give a temporary path beside `target`; rename it over `target` when the block ends well.

    The suffix is kept, because video and array writers choose their format by it. On any
    exception (Ctrl-C included) the temporary file is removed and `target` stays as it was.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=".partial-", suffix=target.suffix, dir=target.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)
        temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_bytes(target: Path, content: bytes) -> None:
    """Write a whole file or nothing."""
    with atomic_path(target) as temporary:
        temporary.write_bytes(content)


def write_json(target: Path, value: Any) -> None:
    """Write JSON with sorted keys, whole or not at all; not-a-number is refused (it is not JSON)."""
    text = json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False)
    write_bytes(target, (text + "\n").encode())


def read_json(source: Path) -> Any:
    """Read JSON; a missing or broken file becomes an `InputError` that names it."""
    try:
        return json.loads(source.read_bytes())
    except FileNotFoundError:
        raise InputError(source, "file", "missing", "an existing JSON file") from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(source, "content", str(error), "valid JSON") from None


def file_sha256(source: Path) -> str:
    """SHA-256 of a file's bytes, as 64 hexadecimal digits."""
    digest = hashlib.sha256()
    with source.open("rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def value_sha256(value: Any) -> str:
    """SHA-256 of a JSON-able value in canonical form (sorted keys, no spaces)."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
