"""Head of the viewer's page for one rendering: title, description and picture, which search engines and messengers show for a link."""

import re
from html import escape
from typing import Final

from map3d.publish.preview_picture import HEIGHT_PX, WIDTH_PX
from map3d.tiles.manifest import Manifest

_TITLE: Final = re.compile(r"<title>[^<]*</title>\n?")
_CHARSET: Final = re.compile(r"<meta charset=[^>]*>")
MAX_TITLE: Final = 200
MAX_DESCRIPTION: Final = 500
"""Characters; longer texts are cut in pages. The manifest has them in full."""

VIEWER_POLICY: Final = (
    "default-src 'self'; img-src 'self' data: blob:; worker-src 'self' blob:; connect-src 'self' blob: data: https: http:; "
    "object-src 'none'; base-uri 'none'; form-action 'self'"
)
"""Content security policy of the viewer's page. It may fetch tiles from other hosts, which the page does only with the user's consent
(`?rendering=`); it runs no script and shows no style but its own."""


def add_policy(page: str) -> str:
    """Returns the page with its content security policy in a meta element, for hosts that send no headers."""
    row = f'<meta http-equiv="Content-Security-Policy" content="{VIEWER_POLICY}">'
    charset = _CHARSET.search(page)
    return _insert(page, row + "\n") if charset is None else page[: charset.end()] + row + page[charset.end() :]


def cut(text: str, limit: int) -> str:
    """Returns the text, with an ellipsis at its end if it is longer than `limit` characters."""
    return text if len(text) <= limit else text[: limit - 1] + "…"


def describe_page(page: str, manifest: Manifest, picture: str | None, url: str | None = None) -> str:
    """Returns the page with the rendering's title and metadata. `picture`: URL of a picture of WIDTH_PX × HEIGHT_PX or None; `url`: that of the
    page."""
    title, description = cut(manifest.title or manifest.name, MAX_TITLE), cut(_description(manifest), MAX_DESCRIPTION)
    rows = [
        f"<title>{escape(title)}</title>",
        f'<meta name="description" content="{escape(description)}">',
        f'<meta property="og:title" content="{escape(title)}">',
        f'<meta property="og:description" content="{escape(description)}">',
        '<meta property="og:type" content="website">',
    ]
    if url is not None:
        rows.append(f'<meta property="og:url" content="{escape(url)}">')
    if picture is not None:
        rows += [
            f'<meta property="og:image" content="{escape(picture)}">',
            f'<meta property="og:image:width" content="{WIDTH_PX}">',
            f'<meta property="og:image:height" content="{HEIGHT_PX}">',
            '<meta name="twitter:card" content="summary_large_image">',
        ]
    return _insert(_TITLE.sub("", page, count=1), "\n".join(rows) + "\n")


def _description(manifest: Manifest) -> str:
    if manifest.description:
        return manifest.description
    count = len(manifest.views)
    return f"Oblique map in {count} {'view' if count == 1 else 'views'}. {manifest.attribution}".strip()


def _insert(page: str, rows: str) -> str:
    """Inserts the rows at the end of the head; without one, behind the doctype."""
    at = page.find("</head>")
    if at < 0:
        doctype = re.match(r"\s*<!doctype[^>]*>\n?", page, re.IGNORECASE)
        at = doctype.end() if doctype else 0
    return page[:at] + rows + page[at:]
