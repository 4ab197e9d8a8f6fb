"""What the pages of a site link to, and what can be linked to in them."""

from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

_ADDRESSES = {"a": "href", "link": "href", "img": "src", "script": "src", "iframe": "src", "source": "src"}


@dataclass
class Links(HTMLParser):
    """Reads one page."""

    found: list[str] = field(default_factory=list)
    anchors: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        """Begin with an empty page."""
        super().__init__()

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        """Note what a tag is called and where it leads."""
        values = dict(attributes)
        self.anchors.update(value for key in ("id", "name") if (value := values.get(key)))
        address = values.get(_ADDRESSES.get(tag, ""))
        if address:
            self.found.append(address)


def read(page: Path) -> Links:
    """Return what stands in a page."""
    links = Links()
    links.feed(page.read_text(encoding="utf-8"))
    return links


def dead_links(site: Path) -> list[str]:
    """Name every link within a site that leads nowhere."""
    pages = {path: read(path) for path in site.rglob("*.html")}
    dead = []
    for page, links in pages.items():
        for address in links.found:
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            target = target / "index.html" if target.is_dir() else target
            known = pages[target].anchors if target in pages else None
            if not target.is_file() or (
                parts.fragment and known is not None and unquote(parts.fragment) not in known
            ):
                dead.append(f"{page.relative_to(site)}: {address}")
    return sorted(set(dead))
