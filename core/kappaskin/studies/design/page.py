"""What is known of a study to one HTML page that needs no network."""

import html
import platform
from collections.abc import Mapping, Sequence

from kappaskin.studies.design.known import Known
from kappaskin.studies.design.measures import MEASURES
from kappaskin.studies.design.study import Study
from kappaskin.studies.design.table import heads_of, remarks_on, rows_of
from kappaskin.studies.design.task import version

_STYLE = """
:root { color-scheme: light dark; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: .2rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
figure { margin: 1rem 0; padding: .6rem; background: #fff; color: #16191d;
  border: 1px solid #c6ccd4; border-radius: 6px; }
figure svg { width: 100%; height: auto; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9rem; }
th, td { padding: .25rem .7rem; text-align: right; border-bottom: 1px solid #9aa3ad55; }
td { white-space: nowrap; } th { vertical-align: bottom; max-width: 11rem; }
pre { overflow-x: auto; padding: .8rem; border: 1px solid #9aa3ad88; border-radius: 6px;
  font-size: .82rem; line-height: 1.4; }
.faint { opacity: .75; }
"""


def page_of(study: Study, known: Sequence[Known], figures: Mapping[str, str]) -> str:
    """The page, with `figures` as SVG by the name of what they show."""
    drawn = [
        f"<figure role='img' aria-label='{html.escape(MEASURES[name].title)}'>{_bare(svg)}</figure>"
        for name, svg in figures.items()
    ]
    remarks = "".join(f"<li>{html.escape(remark)}</li>" for remark in remarks_on(study, known))
    computed = sum(one.done for one in known)
    parts = [
        f"<h1>{html.escape(study.title)}</h1>",
        f"<p>{html.escape(study.description.strip())}</p>",
        f"<p class='faint'>{len(known)} points, {computed} blocks of "
        f"{study.base.measure.frames} frames. Bars and ± are 95 % intervals of the mean. "
        "What varies is in the units of scene files: m, 1/m, N and s.</p>",
        f"<h2>To be known with it</h2><ul>{remarks}</ul>" if remarks else "",
        *drawn,
        "<h2>Table</h2>",
        f"<div class='wide'>{_table(study, known)}</div>",
        "<h2>To repeat it</h2>",
        f"<p>Save this as {html.escape(study.name)}.toml and run "
        f"<code>kappaskin study {html.escape(study.name)}.toml</code>, with "
        f"{html.escape(version())} (here on Python {platform.python_version()}). The same numbers "
        "come out to the last bit, but for times.</p>",
        f"<pre>{html.escape(study.text)}</pre>",
    ]
    return (
        f"<!doctype html>\n<html lang='en'><head><meta charset='utf-8'><meta name='viewport' "
        f"content='width=device-width'><title>{html.escape(study.title)}</title>"
        f"<style>{_STYLE}</style></head><body>\n" + "\n".join(filter(None, parts))
        + "\n</body></html>\n"
    )  # fmt: skip


def _bare(svg: str) -> str:
    """The SVG as it stands inside a page: without what begins a file."""
    return svg[svg.index("<svg") :]


def _table(study: Study, known: Sequence[Known]) -> str:
    def line(cells: Sequence[str], kind: str) -> str:
        return "<tr>" + "".join(f"<{kind}>{html.escape(cell)}</{kind}>" for cell in cells) + "</tr>"

    rows = "\n".join(line(row, "td") for row in rows_of(study, known))
    head = line(heads_of(study), "th")
    return f"<table><thead>{head}</thead><tbody>\n{rows}\n</tbody></table>"
