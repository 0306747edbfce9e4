"""Names with markup: what is exported has the elements that it has with plain names."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import pytest

import pgraph_core as pg

HOSTILE = (
    "</script><script>alert(1)</script>",
    "\"><img src=x onerror='alert(1)'>",
    "</title></svg><svg onload=alert(1)>",
    "--><!--<script>",
    "`${alert(1)}`</style>",
    "&lt;script&gt;&#60;b&#62;",
    "]]><script/>",
)


def model(name: str) -> pg.Model:
    rod = pg.Shape(kind="box", size=(1.0, 0.1, 0.1))
    bodies = [
        pg.Body(name=f"{name}1", axes=(0, 1, 0), shape=rod, com=(0.5, 0, 0), tip=(1, 0, 0)),
        pg.Body(name=f"{name}2", parent=f"{name}1", link=(1, 0, 0), axes=(0, 1, 0), shape=rod),
    ]
    return pg.Model(
        name=name,
        bodies=bodies,
        forces=[pg.Torsion(name=f"{name}s", body=f"{name}1", axis=(0, 1, 0), stiffness=1.0)],
        outputs=[pg.Output(name=f"{name}o", kind="position", at=f"{name}2")],
        sites=[pg.Site(name=f"{name}p", body=f"{name}2", point=(1, 0, 0))],
    )


class Elements(HTMLParser):
    """The elements of a page, with the names of their attributes."""

    def __init__(self, page: str):
        super().__init__(convert_charrefs=True)
        self.found: list[tuple[str, tuple[str, ...]]] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, tuple(name for name, _ in attrs)))
        for name, text in attrs:
            if name == "srcdoc" and text:
                self.found += Elements(text).found

    def handle_comment(self, data):
        self.found.append(("comment", ()))


def pages(name: str, folder: Path) -> dict[str, str]:
    """What of a model and its run is HTML or SVG."""
    one = model(name)
    run = pg.simulate(one, t_end=0.05, step=1e-2, method="rk4", frames=5)
    found = {
        "model": one._repr_html_(),
        "mechanism": pg.Mechanism(one)._repr_html_(),
        "run": run._repr_html_(),
    }
    for kind, given in (("recorded", {}), ("live", {"live": True})):
        run.to_html(folder / f"{kind}.html", **given)
        found[kind] = (folder / f"{kind}.html").read_text()
    one.to_image(folder / "digraph.svg", what="digraph")
    found["digraph"] = (folder / "digraph.svg").read_text()
    return found


@pytest.fixture(scope="module")
def plain(tmp_path_factory) -> dict[str, list]:
    return {
        kind: Elements(page).found
        for kind, page in pages("plain", tmp_path_factory.mktemp("plain")).items()
    }


@pytest.mark.parametrize("name", HOSTILE)
def test_no_name_adds_an_element_or_an_attribute(name: str, plain, tmp_path):
    for kind, page in pages(name, tmp_path).items():
        assert Elements(page).found == plain[kind], kind
        scripts = re.findall(r"<script.*?</script>", page, flags=re.DOTALL | re.IGNORECASE)
        assert not any(name in script for script in scripts if "<" in name), kind


@pytest.mark.parametrize("name", HOSTILE)
def test_xml_files_of_such_names_are_read_as_they_were(name: str, tmp_path):
    """A format that cannot hold a name changes it, and its report says so."""
    for suffix, write, read in (
        ("urdf", pg.write_urdf, pg.read_urdf),
        ("xml", pg.write_mjcf, pg.read_mjcf),
    ):
        path = tmp_path / f"a.{suffix}"
        write(model(name), path)
        tags = {element.tag for element in ElementTree.parse(path).iter()}
        assert not {"script", "img", "svg"} & tags
        if suffix == "urdf" and "${" in name:  # an expression of xacro
            with pytest.raises(pg.FileError, match="xacro"):
                read(path)
        elif suffix == "urdf" or pytest.importorskip("mujoco"):
            assert len(read(path)[0].bodies) >= 2
