"""A figure as markup: its words are text, its colours are those of the page, in light and in dark."""

from __future__ import annotations

import io
import re
import warnings
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from gsl.report.style import ROLES, lay_out, look

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 5.4  # of a figure on a page [in]; its words stay readable on a phone, which shows it at 0.7 of its size

_HEAD = re.compile(r"<svg [^>]*viewBox=\"([^\"]+)\"[^>]*>")
_OWN_ID = re.compile(r"<g id=\"[^\"]*\">")
_COLOUR = re.compile("|".join(ROLES))


def svg(figure: Figure, title: str) -> Markup:
    """Return a figure as it is drawn on a page: equal figures give equal bytes, and only equal parts have equal names.

    Args:
        figure: One that is wider than `WIDTH` takes the page's width.
        title: What it shows, for those who cannot see it.
    """
    import matplotlib
    from matplotlib.text import Text

    file = io.StringIO()
    settings: Any = {"svg.fonttype": "none", "svg.hashsalt": "gsl", "path.simplify_threshold": 0.2}
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with look(), matplotlib.rc_context(settings), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")  # the reader's own font has it
        lay_out(figure)
        for text in figure.findobj(Text):
            text.set_path_effects([])  # else its letters are drawn as shapes
        figure.savefig(file, format="svg", metadata=nothing)
    whole = file.getvalue()
    (size,) = _HEAD.findall(whole)[:1]
    inside = whole[whole.index(">", whole.index("<svg ")) + 1 : whole.rindex("</svg>")]
    inside = _OWN_ID.sub("<g>", inside.replace("xlink:href", "href").replace("'DejaVu Sans'", "var(--font)"))
    inside = _COLOUR.sub(lambda match: f"var(--{ROLES[match[0]]})", re.sub(r"\n\s*", "\n", inside))
    drawn = Markup('<svg viewBox="{}" role="img" aria-label="{}">').format(size, title) + Markup(inside + "</svg>")
    return drawn if figure.get_figwidth() <= WIDTH else Markup('<div class="wide broad">{}</div>').format(drawn)
