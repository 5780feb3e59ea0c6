"""Every text of the templates has a translation, and every translation a text."""

import json
import re
from pathlib import Path

import pytest

import map3d.web
from map3d.web.pages.language import LANGUAGES
from map3d.web.studio.forms import FORMS, more_fields

FOLDER = Path(map3d.web.__file__).parent
CALL = re.compile(r"""(?:\b_|\btranslate|\bN_)\(\s*(?:"((?:[^"\\]|\\.)*)"|'((?:[^'\\]|\\.)*)')""")
FROM_DATA = {"editor", "viewer", "OBJ with textures", "Terrain"}
"""Texts that templates translate from values."""


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_every_text_is_translated(language):
    files = [*FOLDER.glob("templates/**/*.html"), *FOLDER.glob("**/*.py")]
    texts = {(one or other).replace('\\"', '"') for file in files for one, other in CALL.findall(file.read_text("utf-8"))} | FROM_DATA
    texts |= {text for name in FORMS for one in more_fields(name) for text in (one.param.label, one.param.default) if re.search("[A-Za-z]{2}", text)}
    translated = json.loads((FOLDER / "translations" / f"{language}.json").read_text("utf-8"))
    assert sorted(texts - set(translated)) == []
    assert sorted(set(translated) - texts) == []
    for text, other in translated.items():
        assert sorted(re.findall(r"{\w+}", text)) == sorted(re.findall(r"{\w+}", other)), text
