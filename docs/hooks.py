"""Hooks of MkDocs: generated text, pictures of effects, and Markdown as a site wants it."""

from __future__ import annotations

import re
from typing import Any

from generated import expanded
from mkdocs.structure.files import File, Files
from signatures import pictures

# effect -> caption of its picture
_captions: dict[str, str] = {}
_FENCE = re.compile(r"^```([\w+-]+) [^\n]*$", re.MULTILINE)
_LANGUAGES = {"CMD": "text", "csv": "text"}
_EFFECT = re.compile(r"^### (\w+)$", re.MULTILINE)
_FOLDER = "images/effects"


def on_files(files: Files, config: Any) -> Files:
    """Add a picture of each effect's signature."""
    for name, svg, caption in pictures():
        _captions[name] = caption
        files.append(File.generated(config, f"{_FOLDER}/{name}.svg", content=svg))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put generated text and pictures in their places, and take the options off the fences."""
    markdown = expanded(markdown)
    if page.file.src_path == "effects.md":
        markdown = _EFFECT.sub(_illustrated, markdown)
    return _FENCE.sub(lambda match: f"```{_LANGUAGES.get(match[1], match[1])}", markdown)


def _illustrated(match: re.Match[str]) -> str:
    name = match[1]
    if name not in _captions:
        return match[0]
    return f"{match[0]}\n\n![{_captions[name]}]({_FOLDER}/{name}.svg)"
