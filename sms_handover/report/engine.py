"""Template engine and plotting library of the page: jinja2, which escapes every text, and plotly."""

from importlib import import_module
from importlib.resources import files
from typing import Any

from sms_handover.errors import MissingDependencyError

_PACKAGE = "sms_handover.report"
_WEB = "web"


def render(template: str, **values: object) -> str:
    """Return a rendered template of ``web/``; every value is escaped, a missing name is an error."""
    jinja2 = _needed("jinja2")
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(_PACKAGE, _WEB),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return str(environment.get_template(template).render(values))


def web_file(name: str) -> str:
    """Return a style sheet or script of ``web/``."""
    return (files(_PACKAGE) / _WEB / name).read_text(encoding="utf-8")


def plotly_script() -> str:
    """Return plotly.js, about 5 MB, from the installed plotly package."""
    return str(_needed("plotly.offline").get_plotlyjs())


def _needed(module: str) -> Any:
    """Return an optional module; raises MissingDependencyError if it is not installed."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        package = module.partition(".")[0]
        raise MissingDependencyError("reports", package, "analysis") from error
