"""The libraries behind the page: templates that escape every text, and plotly's script."""

from importlib import import_module
from importlib.resources import files
from typing import Any

from sms_handover.errors import MissingDependencyError

_PACKAGE = "sms_handover.report"
_WEB = "web"


def render(template: str, **values: object) -> str:
    """Return a template of ``web/`` filled in; every value is escaped, a name that is missing is an error."""
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
    """Return the text of a style sheet or script of ``web/``."""
    return (files(_PACKAGE) / _WEB / name).read_text(encoding="utf-8")


def plotly_script() -> str:
    """Return plotly.js, about 5 MB, in the version of the installed plotly package."""
    return str(_needed("plotly.offline").get_plotlyjs())


def _needed(module: str) -> Any:
    """Return a module that only reports need; raises MissingDependencyError if it is not installed."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        package = module.partition(".")[0]
        raise MissingDependencyError("reports", package, "analysis") from error
