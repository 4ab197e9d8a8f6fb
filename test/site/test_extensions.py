"""What the site makes of Markdown written for GitHub, and of docstrings written as plain text."""

import pytest
from sphinx.errors import SphinxError

from docs.extensions.docstrings import without_substitutions
from docs.extensions.repository_links import for_the_site

LINKS = {
    "[a file](../config/plant.yaml)": "[a file](configuration.md#plantyaml)",
    "[a folder](../config)": "[a folder](configuration.md)",
    "[a type](../interfaces/msg/TaskPhase.msg)": "[a type](messages.md#taskphase)",
    "[a package](../sms_handover/bag/)": "[a package](api/sms_handover.bag.rst)",
    "[a test](../test/test_documents.py)": "[a test](../test/test_documents.py)",
    "[a page](../sms_handover/scene/web/README.md)": "a page",
    "[metrics.md](metrics.md)": "[](metrics.md)",
    "[bags.md](bags.md#check)": "[](bags.md#check)",
    "[Metrics](metrics.md)": "[Metrics](metrics.md)",
    "![x](images/x.png)": "![x](images/x.png)",
}


@pytest.mark.parametrize(("written", "expected"), LINKS.items(), ids=LINKS)
def test_links_lead_to_pages_of_the_site(written: str, expected: str) -> None:
    assert for_the_site(f"before {written}, after", "page.md") == f"before {expected}, after"


def test_a_dead_link_is_refused() -> None:
    with pytest.raises(SphinxError, match="there is no config"):
        for_the_site("[x](../config/no.yaml)", "page.md")


def test_bars_are_absolute_values() -> None:
    assert without_substitutions("the size |v|, not ``a | b``") == r"the size \|v\|, not ``a | b``"
