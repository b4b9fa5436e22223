"""The docs as a site: built strictly, links lead somewhere, nothing comes from the network."""

import importlib.util
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


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-d", folder], cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return {path: Links(path.read_text("utf-8")) for path in sorted(folder.glob("*.html"))}


def test_every_link_and_anchor_leads_somewhere(pages):
    count = 0
    for path, page in pages.items():
        if path.name == "404.html":  # its links are those of a server's root
            continue
        for target in page.links + page.loaded:
            parts = urlsplit(target)
            if parts.scheme:
                continue
            file = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert file.exists(), f"{path.name}: {target}"
            if parts.fragment and file in pages:
                assert parts.fragment in pages[file].anchors, f"{path.name}: {target}"
            count += 1
    assert count > 1000


def test_nothing_is_loaded_from_elsewhere(pages):
    for page in pages.values():
        assert [target for target in page.loaded if urlsplit(target).scheme] == []


def test_each_effect_has_a_picture_of_its_signature(pages):
    (page,) = (page for path, page in pages.items() if path.name == "effects.html")
    shown = {re.sub(r".*/(\w+)\.svg", r"\1", target) for target in page.loaded if "svg" in target}
    assert shown >= own_effects().keys() - INVISIBLE
    assert not shown & INVISIBLE


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
    spec = importlib.util.spec_from_file_location("pictures", ROOT / "docs" / "pictures.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


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
