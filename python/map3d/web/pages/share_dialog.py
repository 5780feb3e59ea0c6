"""Adds the share dialog to the viewer's page when it is served. A published page shares the plain link, since nothing there makes pictures."""

from typing import Final

_SCRIPTS: Final = (
    '<script src="../../static/share/open_link.js"></script>\n'
    '<link rel="stylesheet" href="../../static/share/share.css">\n'
    '<script type="module" src="../../static/share/share.js"></script>\n'
)


def add_share_dialog(page: str) -> str:
    """Inserts the scripts before those of the page: the view of the link's query is moved to the fragment before the viewer reads it."""
    at = page.find("<script")
    return page if at < 0 else page[:at] + _SCRIPTS + page[at:]
