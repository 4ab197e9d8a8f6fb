"""Links of the pages: on GitHub they show a file by its name, on the site a page by its title."""

import re
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.errors import SphinxError

ROOT = Path(__file__).resolve().parents[2]

_LINK = re.compile(r"(!?)\[([^\]]*)\]\(\.\./([^)\s#]*)(#[^)\s]*)?\)")
_FILE_NAME = re.compile(r"(?<!!)\[([\w]+\.md)\]\((\1[^)]*)\)")
_PAGES = {
    "README.md": "index.md",
    "CHANGELOG.rst": "changelog.rst",
    "CONTRIBUTING.md": "contributing.md",
    "config": "configuration.md",
    "interfaces": "messages.md",
}


def for_the_site(markdown: str, page: str) -> str:
    """Return the text of a page with links that the site can follow; raises SphinxError at a dead one.

    A file of config or interfaces leads to where it is shown, a package to its API, other files are kept with
    the site. Of what the site has not, a folder or a page elsewhere, the words remain. Words that are the
    name of the file of a page become its title.
    """

    def replace(found: re.Match[str]) -> str:
        image, words, path, anchor = found[1], found[2], found[3].rstrip("/"), found[4] or ""
        if not (ROOT / path).exists():
            raise SphinxError(f"docs/{page}: there is no {path}, which it links to")
        target = _target(path, anchor)
        return f"{image}[{words}]({target})" if target else words

    return _FILE_NAME.sub(r"[](\2)", _LINK.sub(replace, markdown))


def _target(path: str, anchor: str) -> str:
    """Return what a link to a path of the repository becomes, '' if the site has nothing for it."""
    if path in _PAGES:
        return _PAGES[path] + anchor
    folder, _, name = path.rpartition("/")
    if folder in ("interfaces/msg", "interfaces/srv"):
        return f"messages.md#{Path(name).stem.lower()}"
    if folder == "config" and name.endswith(".yaml"):
        return f"configuration.md#{name.replace('.', '')}"
    if path.startswith("sms_handover") and (ROOT / path / "__init__.py").is_file():
        return f"api/{path.replace('/', '.')}.rst"
    return f"../{path}" if (ROOT / path).is_file() and not path.endswith((".md", ".rst")) else ""


def _on_read(app: Sphinx, page: str, source: list[str]) -> None:
    """Change a Markdown page as it is read."""
    if app.env.doc2path(page).suffix == ".md":
        source[0] = for_the_site(source[0], f"{page}.md")


def setup(app: Sphinx) -> dict[str, bool]:
    """Take every page."""
    app.connect("source-read", _on_read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
