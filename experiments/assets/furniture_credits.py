"""The furniture section of `CREDITS.md`: who made which piece."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from renderer.files import write_bytes

_BEGIN, _END = "<!-- furniture: begin -->", "<!-- furniture: end -->"
_TITLE = "# Credits\n\nWhat the project derives from the work of others, and under which terms.\n"


def write(target: Path, pieces: dict[str, dict[str, Any]]) -> None:
    """Replace the section in the file, or append it; the rest of the file stays as it is."""
    text = target.read_text(encoding="utf-8") if target.is_file() else _TITLE
    section = _section(pieces)
    if _BEGIN in text and _END in text:
        head, rest = text.split(_BEGIN, 1)
        text = head + section + rest.split(_END, 1)[1]
    else:
        text = text.rstrip("\n") + "\n\n" + section + "\n"
    write_bytes(target, text.encode())


def _section(pieces: dict[str, dict[str, Any]]) -> str:
    lines = [
        _BEGIN,
        "## Furniture (`furniture.json`, `furniture_*.npz`)",
        "",
        "Derived from the library *Blend Swap CC-0* (file `BlendSwap-CC-0.sh3f`, Debian package",
        "`sweethome3d-furniture`): models by authors of blendswap.com under Creative Commons Zero",
        "(public domain), cleaned and converted to OBJ by Emmanuel Puybaret. Here they were repaired,",
        "decimated, recoloured and packed by `build_furniture.py`. CC0 asks for no credit; we give it.",
        "",
        "| piece | title | author | triangles before, after |",
        "| --- | --- | --- | --- |",
    ]
    for name, facts in sorted(pieces.items()):
        counts = f"{facts['source_triangles']}, {facts['triangles']}"
        lines.append(f"| `{name}` | {facts['title']} | {facts['creator']} | {counts} |")
    return "\n".join([*lines, _END])
