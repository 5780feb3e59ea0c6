"""The head of a page: its policy, and texts that are cut."""

import pytest

from map3d.publish.page_head import VIEWER_POLICY, add_policy, cut
from map3d.tiles.viewer_files import PAGE, viewer_folder


@pytest.mark.parametrize(
    "page", ["<!doctype html>\n<head><meta charset=utf-8><script src=a.js></script></head>", "<!doctype html>\n<p>no head", "<head></head>"]
)
def test_the_policy_is_there_once_and_before_scripts(page):
    made = add_policy(page)
    row = f'<meta http-equiv="Content-Security-Policy" content="{VIEWER_POLICY}">'
    assert made.count(row) == 1
    assert made.replace(row, "").replace("\n", "") == page.replace("\n", "")
    assert "<script" not in made or made.index(row) < made.index("<script")


def test_the_policy_comes_before_everything_that_the_viewers_page_loads():
    made = add_policy((viewer_folder() / PAGE).read_text("utf-8"))
    assert made.index("Content-Security-Policy") < min(made.index(text) for text in ("<script", "<link", "<style") if text in made)


def test_nothing_unsafe_is_allowed():
    assert "unsafe" not in VIEWER_POLICY
    assert "script-src" not in VIEWER_POLICY, "default-src 'self' holds"


@pytest.mark.parametrize(("text", "expected"), [("", ""), ("abcde", "abcde"), ("abcdef", "abcd…")])
def test_a_text_is_cut_at_its_limit(text, expected):
    assert cut(text, 5) == expected
