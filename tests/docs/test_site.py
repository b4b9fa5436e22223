"""The docs as a site: built strictly, links lead somewhere, nothing comes from the network."""

import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit

import pytest
import yaml
from PIL import Image

from helpers.paths import ROOT
from helpers.site import module_of_docs
from mopro.effects.registry import own_effects

# Effects that change no reading of cold strokes and of heating by a visible amount.
INVISIBLE = {"force_constant_temperature", "voltage_saturation"}
MOST_BYTES = 400_000


class Links(HTMLParser):
    """Targets of a page's links, what it loads, and its anchors."""

    def __init__(self, text):
        super().__init__()
        self.links, self.loaded, self.anchors = [], [], set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        names = dict(attrs)
        self.anchors |= {names["id"]} if "id" in names else set()
        if tag == "a" and "href" in names:
            self.links.append(names["href"])
        elif tag in ("img", "script", "link") and names.get("rel") != "canonical":
            self.loaded += [names[key] for key in ("src", "href") if key in names]


def built(folder):
    """The pages of the site, by file; AssertionError for a warning of the build."""
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-d", folder], cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return {path: Links(path.read_text("utf-8")) for path in sorted(folder.glob("*.html"))}


def broken_links(pages):
    """Targets that pages link to or load, and that are neither there nor on the network."""
    for path, page in pages.items():
        for target in page.links + page.loaded:
            parts = urlsplit(target)
            file = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchors = pages[file].anchors if file in pages else {parts.fragment}
            lost = not parts.scheme and not file.exists()
            if lost or (parts.fragment and parts.fragment not in anchors):
                yield path.name, target


def test_the_site_is_whole_has_the_signatures_and_loads_nothing_from_elsewhere(tmp_path):
    """In one test, as building takes most of the time."""
    pages = built(tmp_path)
    del pages[tmp_path / "404.html"]  # its links are those of a server's root
    assert sum(len(page.links) for page in pages.values()) > 1000
    assert list(broken_links(pages)) == []
    loaded = [target for page in pages.values() for target in page.loaded]
    assert [target for target in loaded if urlsplit(target).scheme] == []
    shown = {
        target.split("/")[-1].removesuffix(".svg") for target in loaded if "effects/" in target
    }
    assert shown == own_effects().keys() - INVISIBLE


def test_a_broken_link_and_anchor_are_found(tmp_path):
    page = tmp_path / "a.html"
    page.write_text('<p id="here"><a href="#here"><a href="#there"><img src="b.svg">')
    pages = {page: Links(page.read_text())}
    assert list(broken_links(pages)) == [("a.html", "#there"), ("a.html", "b.svg")]


def test_every_page_is_in_the_navigation():
    listed = re.findall(r"([\w-]+\.md)", (ROOT / "mkdocs.yml").read_text("utf-8"))
    assert sorted(listed) == sorted(path.name for path in (ROOT / "docs").glob("*.md"))


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "examples/README.md"])
def test_links_of_pages_beside_the_site_lead_to_files(name):
    page = ROOT / name
    targets = re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text("utf-8"))
    assert targets
    assert [t for t in targets if "//" not in t and not (page.parent / t).exists()] == []


@pytest.fixture(scope="module")
def drawing():
    return module_of_docs("pictures")


def test_the_pictures_show_what_comes_out_today(drawing):
    """`python docs/pictures.py` draws them anew."""
    today = {make: make()[1] for make in {make for make, _ in drawing.PICTURES.values()}}
    for name, (make, _) in drawing.PICTURES.items():
        with Image.open(drawing.IMAGES / name) as picture:
            kept = json.loads(picture.info["Description"])
        assert kept == pytest.approx(today[make], rel=0.02), name


def test_the_pictures_are_small_and_no_others_are_kept(drawing):
    kept = list(drawing.IMAGES.iterdir())
    assert {path.name for path in kept} == drawing.PICTURES.keys()
    assert sum(path.stat().st_size for path in kept) < MOST_BYTES


def test_the_citation_is_of_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert citation.keys() >= {"cff-version", "message", "title", "authors", "version"}
    text = (ROOT / "pyproject.toml").read_text("utf-8")
    assert f'version = "{citation["version"]}"' in text
