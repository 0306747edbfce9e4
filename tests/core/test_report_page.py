"""The page of a report: one file that needs nothing else, whose texts cannot break it."""

from __future__ import annotations

import re

from pgraph_core.study.page import Section, page, series_colour, table


def test_a_page_needs_nothing_from_elsewhere():
    text = page("Stiff <rod>", [Section("Map", '<svg viewBox="0 0 1 1"></svg>')], ["a & b"])
    assert text.startswith("<!doctype html>")
    assert "Stiff &lt;rod&gt;" in text
    assert "a &amp; b" in text
    assert not re.search(r"""(src|href)\s*=|@import|url\(|https?:""", text)


def test_a_page_has_both_colour_schemes():
    text = page("", [])
    light, dark = re.findall(r"--ink: (#\w+);", text)
    assert light != dark
    assert series_colour(1) == series_colour(9)


def test_tables_escape_what_they_show():
    assert "<td>&lt;b&gt;</td>" in table(["name"], [["<b>"]])
