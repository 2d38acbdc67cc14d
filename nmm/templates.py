"""Pages from templates: strict about names, and careful with what users wrote."""

from __future__ import annotations

from jinja2 import Environment, PackageLoader, StrictUndefined, Template


def template(package: str, folder: str, name: str) -> Template:
    """A template in a package's folder; a name that it is not given is an error, and text is escaped."""
    environment = Environment(
        loader=PackageLoader(package, folder),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)
