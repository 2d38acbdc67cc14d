"""Pages from templates: strict about names, and careful with what users wrote.

`head.html` begins a page to be read, called `title`, in the look of `page.css`, light and dark; any template
may include it.
"""

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined, Template


def template(package: str, folder: str, name: str) -> Template:
    """A template in a package's folder; a name that it is not given is an error, and text is escaped."""
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package, folder), PackageLoader("nmm.base.templates", ".")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)
