"""The look of a diagnosis' page: one column on a phone, two on a desk, light and dark, and on paper."""

from __future__ import annotations

from gsl.report.diagnosis_html import Html
from gsl.report.style import COMMAND, GROUNDED, INK, REAL, SIMULATION

_LIGHT = f"""
  --ink: {INK}; --soft: #5c5c5c; --faint: #8a8a8a; --line: #dddddd; --paper: #ffffff; --card: #f6f6f4;
  --real: {REAL}; --before: {SIMULATION}; --after: {GROUNDED}; --command: {COMMAND}; --other: #8c8c8c;
  --heat: 0, 114, 178; --warn: #a65a00;"""

_DARK = """
  --ink: #e9e9e7; --soft: #b4b4b2; --faint: #8b8b8b; --line: #3a3d42; --paper: #17191c; --card: #202327;
  --real: #f0803c; --before: #56b4e9; --after: #2fbf94; --command: #9a9a9a; --other: #9a9a9a;
  --heat: 40, 140, 210; --warn: #f0a850;"""

_TEXT = """
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); font: 1rem/1.5 system-ui, "DejaVu Sans", sans-serif; }
main { max-width: 62rem; margin: 0 auto; padding: 1rem; overflow-wrap: anywhere; }
h1 { font-size: 1.45rem; line-height: 1.25; margin: 0 0 .4rem; }
h2 { font-size: 1.15rem; margin: 0 0 .4rem; }
h3 { font-size: .95rem; margin: .9rem 0 .3rem; }
p { margin: 0 0 .5rem; }
section { margin: 2rem 0; padding-top: 1rem; border-top: 1px solid var(--line); }
ul, ol { margin: 0; padding-left: 1.3rem; }
code { font: .88em/1.4 ui-monospace, "DejaVu Sans Mono", monospace; }
pre { margin: .2rem 0 .6rem; padding: .4rem .6rem; background: var(--paper); border: 1px solid var(--line);
  border-radius: 4px; white-space: pre-wrap; }
pre code { display: block; padding-left: 1.2rem; text-indent: -1.2rem; }
.note, .kicker, figcaption { color: var(--soft); font-size: .88rem; }
.verdict { border-left: 6px solid var(--hue, var(--faint)); padding: .2rem 0 .2rem .9rem; margin-bottom: 1rem; }
.verdict .kicker { margin: 0; }
.verdict .mark { color: var(--hue, var(--faint)); font-weight: 800; }
.no_gap { --hue: var(--after); } .causes { --hue: var(--real); } .inseparable, .unknown { --hue: var(--warn); }
.answers { columns: 24rem; column-gap: .8rem; }
.card { background: var(--card); border-radius: 6px; padding: .8rem .9rem; margin-bottom: .8rem; break-inside: avoid; }
.card > div + div { margin-top: .9rem; }
.card h2 { font-size: .85rem; color: var(--soft); font-weight: 600; }
.card p:last-child { margin-bottom: 0; }
.cause { font-size: 1.05rem; margin-bottom: .1rem; }
.parameters > span { display: inline-block; margin-right: 1.2em; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .25rem 1rem; margin: 0; }
dt { color: var(--soft); } dd { margin: 0; }
"""

_TABLES = """
.wide { overflow-x: auto; margin: .6rem 0; }
table { border-collapse: collapse; font-size: .9rem; overflow-wrap: normal; font-variant-numeric: tabular-nums; }
td { white-space: nowrap; }
th, td { padding: .25rem .9rem .25rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line); }
thead th { color: var(--soft); font-weight: 600; vertical-align: bottom; }
tbody th { font-weight: 600; position: sticky; left: 0; background: var(--paper); }
.map { border-collapse: separate; border-spacing: 2px; font-size: .85rem; }
.map th, .map td { border: 0; padding: .2rem .35rem; }
.map thead th { max-width: 5.5rem; line-height: 1.15; }
.map td { text-align: center; min-width: 3.6rem; }
.map .noise { color: var(--faint); }
.map .named { background: rgba(var(--heat), var(--share)); outline: 2px solid rgb(var(--heat)); outline-offset: -2px;
  font-weight: 700; }
"""

_CHARTS = """
figure { margin: .4rem 0 1rem; }
.axis { margin: 0 0 .3rem; font-size: .8rem; color: var(--soft); }
.axis.right { text-align: right; margin-top: 1.5rem; }
.plot { position: relative; height: 15rem; margin: 0 .6rem 0 2.8rem; }
.plot svg { position: absolute; width: 100%; height: 100%; overflow: visible; }
.square { max-width: 24rem; } .plot.square { height: 20rem; } .line.thin { stroke-width: 1; opacity: .7; }
.tick { position: absolute; font-size: .75rem; line-height: 1; color: var(--soft); white-space: nowrap; }
.tick.y { right: 100%; transform: translate(-.4rem, -50%); } .tick.x { top: 100%; transform: translate(-50%, .4rem); }
.line { fill: none; stroke: var(--stroke, var(--ink)); stroke-width: 2; vector-effect: non-scaling-stroke;
  stroke-linejoin: round; }
.grid { fill: none; stroke: var(--line); stroke-width: 1; vector-effect: non-scaling-stroke; }
.fill { fill: var(--stroke, var(--ink)); }
.real { --stroke: var(--real); } .before { --stroke: var(--before); } .after { --stroke: var(--after); }
.command { --stroke: var(--command); } .other { --stroke: var(--other); } .quiet { --stroke: var(--faint); }
.line.real { stroke-width: 3.5; } .line.command { stroke-width: 1.2; stroke-dasharray: 5 3; }
.line.after { stroke-dasharray: 9 3; } .line.quiet { stroke-width: 1; opacity: .6; } .fill.quiet { opacity: .5; }
.line.floor { stroke: var(--ink); stroke-width: 1.2; stroke-dasharray: 4 3; }
.line.joint0 { stroke: var(--ink); } .line.joint1 { stroke: #cc79a7; stroke-dasharray: 9 3; }
.line.joint2 { stroke: #56b4e9; stroke-dasharray: 3 3; } .line.joint3 { stroke: #e69f00; stroke-dasharray: 9 3 2 3; }
.legend { font-size: .85rem; } .legend span { display: inline-block; margin-right: 1.2em; }
.swatch { vertical-align: middle; margin-right: .35em; }
.row { display: grid; grid-template-columns: 13rem 1fr 9rem; gap: 0 .8rem; align-items: center; font-size: .9rem; }
.dots .row { grid-template-columns: 17rem 1fr 14rem; padding: .3rem 0; border-bottom: 1px solid var(--line); }
.track svg { display: block; overflow: visible; font-size: .75rem; } .track text { fill: var(--soft); }
.dots .line { stroke-dasharray: none; } .dots .line.floor { stroke-width: 1; stroke: var(--faint); }
.dots .row:last-child { border: 0; }
"""

_SCREENS = f"""
@media (max-width: 40rem) {{
  .row {{ grid-template-columns: 1fr 8.2rem; }}
  .row .label {{ grid-column: 1 / -1; }} .row .label:empty {{ display: none; }}
  .dots .row {{ grid-template-columns: 1fr; }}
  dl {{ grid-template-columns: 1fr; }} dd {{ margin-bottom: .4rem; }}
  .plot {{ height: 12rem; }}
}}
@media screen and (prefers-color-scheme: dark) {{ :root {{ {_DARK} }} }}
@page {{ margin: 14mm; }}
@media print {{
  * {{ print-color-adjust: exact; -webkit-print-color-adjust: exact; }}
  :root {{ font-size: 11px; }} main {{ padding: 0; max-width: none; }}
  .wide {{ overflow: visible; }} .card, .replay, figure, .row, tr, li {{ break-inside: avoid; }}
  h2, h3, .note {{ break-after: avoid; }} .plot {{ height: 11rem; }}
}}
"""

STYLE = Html(f"<style>:root {{ color-scheme: light dark; {_LIGHT} }}{_TEXT}{_TABLES}{_CHARTS}{_SCREENS}</style>")
