"""Templates of pages: a document of sections, and the elements of sections; text is escaped, except `Markup`."""

from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from ...tabular import table


@cache
def _environment(package: str) -> Environment:
    found = Environment(
        loader=PackageLoader(package, ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.globals["table"] = lambda cells: Markup(table(cells))
    return found


def document(title: str, summary: str, version: str, sections: dict[str, str]) -> str:
    """Return a page of all non-empty sections, HTML by heading, with a table of contents."""
    shown = {name: Markup(body) for name, body in sections.items() if body}
    return rendered(str(__package__), "report.htm", title=title, summary=summary, version=version, sections=shown)


def rendered(package: str, name: str, **values: Any) -> str:
    """Render a template in the folder of a package."""
    return _environment(package).get_template(name).render(**values)


@cache
def elements() -> Any:
    """Return the macros of ``elements.htm`` as functions, which return HTML."""
    return _environment(str(__package__)).get_template("elements.htm").module
