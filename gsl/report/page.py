"""A page: one HTML file that needs nothing else, on a phone, on a desk and on paper, in light and in dark."""

from __future__ import annotations

import base64
import functools
import hashlib
from collections.abc import Mapping, Sequence

from markupsafe import Markup

from gsl.report.parts import Part, environment, render
from gsl.report.style import COLOURS, DARK, LIGHT

_SCRIPT = "choose.js"


def page(template: str, sections: Sequence[Part], **values: object) -> str:
    """Return the text of a page.

    Args:
        template: One that extends base.html, or that itself.
        sections: From above; those that are None are left out.
        values: Whatever else the template shows.
    """
    present = [section for section in sections if section]
    script = _source(_SCRIPT) if any("data-choice" in section for section in present) else ""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    style = render("style.css", light=_declare(LIGHT), dark=_declare(DARK))
    text = render(template, sections=present, style=style, script=Markup(script), script_hash=digest, **values)
    return f"{text}\n"


@functools.cache
def _source(name: str) -> str:
    loader = environment().loader
    assert loader is not None, "our environment has one"
    return loader.get_source(environment(), name)[0]


def _declare(colours: Mapping[str, str]) -> Markup:
    return Markup(" ".join(f"--{name}: {colour};" for name, colour in {**COLOURS, **colours}.items()))
