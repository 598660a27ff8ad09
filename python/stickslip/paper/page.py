"""The report as one HTML file: tables, figures and text, pictures embedded."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Sequence
from pathlib import Path

_STYLE = """
:root { color-scheme: light; --ink: #20242c; --soft: #5b6472; --rule: #e3e6eb; --accent: #1f8a70; --paper: #fff; }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; scroll-behavior: smooth; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 16.5px/1.6 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, "DejaVu Sans", sans-serif; }
main { max-width: 56rem; margin: 0 auto; padding: 3rem 1.25rem 5rem; }
h1 { font-size: clamp(1.8rem, 5vw, 2.5rem); line-height: 1.15; letter-spacing: -0.02em; margin: 0 0 .6rem; }
h2 { font-size: 1.35rem; letter-spacing: -0.01em; margin: 3.4rem 0 .8rem; padding-top: 1.2rem; border-top: 1px solid var(--rule); }
p { margin: .7rem 0; max-width: 46rem; }
.lead { font-size: 1.12rem; color: var(--soft); max-width: 44rem; }
a { color: var(--accent); text-decoration-thickness: 1px; text-underline-offset: 2px; }
code { font: .9em ui-monospace, SFMono-Regular, Menlo, Consolas, monospace; background: #f3f4f6; padding: .1em .35em; border-radius: 4px; }
nav { font-size: .92rem; margin: 1.4rem 0 0; display: flex; flex-wrap: wrap; gap: .3rem 1.1rem; }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(15rem, 1fr)); gap: .8rem; margin: 2rem 0; padding: 0; }
.cards div { background: #f6f7f9; border-radius: 10px; padding: .9rem 1rem 1rem; }
.cards dt { font-size: 1.65rem; font-weight: 650; letter-spacing: -0.02em; line-height: 1.25; font-variant-numeric: tabular-nums; }
.cards dd { margin: .2rem 0 0; font-size: .88rem; line-height: 1.4; color: var(--soft); }
.scroll { overflow-x: auto; margin: 1.1rem 0; -webkit-overflow-scrolling: touch; }
table { border-collapse: collapse; font-size: .92rem; line-height: 1.35; min-width: 34rem; width: 100%; font-variant-numeric: tabular-nums; }
th, td { padding: .38rem .7rem; text-align: right; white-space: nowrap; }
th:first-child, td:first-child, td.t, th.t { text-align: left; }
thead th { font-weight: 600; color: var(--soft); border-bottom: 1.5px solid #c6ccd5; vertical-align: bottom; white-space: normal; }
thead tr.groups th { border-bottom: 0; text-align: center; padding-bottom: 0; color: var(--ink); }
thead tr.groups th:first-child { text-align: left; }
tbody td { border-bottom: 1px solid var(--rule); }
table.dense th, table.dense td { padding: .34rem .42rem; } table.dense { font-size: .86rem; }
tr.strong td { font-weight: 650; }
tr.rule td { border-top: 1.5px solid #c6ccd5; }
sup, sub { line-height: 0; font-size: .72em; }
figure { margin: 1.3rem 0; }
figure img { display: block; width: 100%; height: auto; }
figure .scroll { margin: 0; }
figure .scroll img { min-width: 36rem; }
figcaption { font-size: .9rem; color: var(--soft); margin-top: .5rem; max-width: 46rem; }
.frames { display: grid; grid-template-columns: repeat(6, 1fr); gap: 4px; }
.frames img { border-radius: 5px; }
.frames span { display: block; font-size: .78rem; color: var(--soft); text-align: center; font-variant-numeric: tabular-nums; }
.strip { margin: 1.4rem 0; }
footer { margin-top: 4rem; padding-top: 1rem; border-top: 1px solid var(--rule); font-size: .86rem; color: var(--soft); }
footer dl { display: grid; grid-template-columns: max-content 1fr; gap: .1rem 1rem; margin: .6rem 0; }
footer dd { margin: 0; }
@media (max-width: 640px) { body { font-size: 16px; } main { padding: 1.6rem 1rem 3rem; } .frames { grid-template-columns: repeat(3, 1fr); }
  th, td { padding: .34rem .5rem; } .cards { grid-template-columns: 1fr 1fr; gap: .5rem; } .cards dt { font-size: 1.35rem; } }
@media print { h2 { break-after: avoid; } figure, table { break-inside: avoid; } }
"""


def paragraph(text: str) -> str:
    """Text may hold markup."""
    return f"<p>{text}</p>\n"


def html_table(
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    groups: Sequence[tuple[str, int]] = (),
    strong_rows: Sequence[int] = (),
    rules_before: Sequence[int] = (),
    text_columns: int = 1,
    dense: bool = False,
) -> str:
    """A table that scrolls on a narrow screen; `groups` are (title, columns) above the head."""

    def cells(tag: str, values: Sequence[str]) -> str:
        return "".join(
            f"<{tag} class=t>{v}</{tag}>" if k < text_columns else f"<{tag}>{v}</{tag}>" for k, v in enumerate(values)
        )

    top = ""
    if groups:
        top = "<tr class=groups>" + "".join(f"<th colspan={n}>{title}</th>" for title, n in groups) + "</tr>"
    body = []
    for k, row in enumerate(rows):
        names = [name for name, on in (("strong", k in strong_rows), ("rule", k in rules_before)) if on]
        mark = f' class="{" ".join(names)}"' if names else ""
        body.append(f"<tr{mark}>{cells('td', row)}</tr>")
    return (
        f"<div class=scroll><table{' class=dense' if dense else ''}><thead>{top}<tr>{cells('th', head)}</tr></thead><tbody>"
        + "\n".join(body)
        + "</tbody></table></div>\n"
    )


def figure(file: str, caption: str) -> str:
    """A picture beside the report."""
    alt = html.escape(re.sub(r"<[^>]*>", "", caption), quote=True)
    return (
        f'<figure><div class=scroll><img src="{file}" alt="{alt}"></div><figcaption>{caption}</figcaption></figure>\n'
    )


def section(anchor: str, title: str, body: str) -> str:
    """A part with a heading."""
    return f'<section id="{anchor}"><h2>{title}</h2>\n{body}</section>\n'


def cards(items: Sequence[tuple[str, str]]) -> str:
    """Large numbers with a line each."""
    return (
        "<dl class=cards>" + "".join(f"<div><dt>{value}</dt><dd>{what}</dd></div>" for value, what in items) + "</dl>\n"
    )


def write(path: Path, *, title: str, lead: str, top: str, parts: Sequence[tuple[str, str, str]], foot: str) -> None:
    """Writes the page; `parts` are (anchor, title, body). Pictures beside `path` are embedded."""
    links = "".join(f'<a href="#{anchor}">{name}</a>' for anchor, name, _ in parts)
    body = "".join(section(*part) for part in parts)
    page = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>{_STYLE}</style></head>\n<body><main>\n"
        f"<h1>{title}</h1>\n<p class=lead>{lead}</p>\n<nav>{links}</nav>\n{top}{body}"
        f"<footer>{foot}</footer>\n</main></body></html>\n"
    )
    path.write_text(_embed(page, path.parent), encoding="utf-8")


def _embed(page: str, folder: Path) -> str:
    def data(match: re.Match) -> str:
        file = folder / match[1]
        kind = {".png": "png", ".jpg": "jpeg"}.get(file.suffix)
        if kind is None or not file.is_file():
            return match[0]
        return f'src="data:image/{kind};base64,{base64.b64encode(file.read_bytes()).decode()}"'

    return re.sub(r'src="([\w./-]+)"', data, page)
