"""The page: titles, paragraphs, tables, plots and bars, as HTML and as text."""
import html
import os
import re

STYLE = """
body { font: 15px/1.5 sans-serif; color: #222; max-width: 76em; margin: 2em auto; padding: 0 1em; }
h1, h2, h3 { line-height: 1.2; } h2 { margin-top: 2.2em; border-bottom: 1px solid #bbb; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: 1em 0; font-size: 13px; }
caption { text-align: left; font-weight: bold; padding: .3em 0; }
td, th { border-bottom: 1px solid #ddd; padding: .2em .7em; text-align: right; white-space: nowrap; }
th { vertical-align: bottom; border-bottom: 1px solid #888; }
td.left, th.left { text-align: left; white-space: normal; min-width: 5em; }
.met { background: #e2f2e0; } .missed { background: #f8dedb; } .open { background: #f2f2f2; }
pre { background: #f6f6f6; padding: 1em; overflow-x: auto; font-size: 12px; line-height: 1.35; }
img { max-width: 100%; height: auto; }
code { background: #f3f3f3; padding: 0 .2em; white-space: nowrap; }
"""
MET = {True: ("met", "met"), False: ("not met", "missed"), None: ("not measured", "open")}


class Bar:
    """Something to be reached: what, how much, what was found, whether that is enough
    (None: not measured)."""

    def __init__(self, what, bar, figure, met):
        self.what, self.bar, self.figure, self.met = what, bar, figure, met

    def cells(self):
        return [self.what, self.bar, self.figure, MET[self.met][0]]


class Table:
    """head: names of columns, those at the left are aligned left. Cells are text."""

    def __init__(self, caption, head, rows, left=1):
        self.caption, self.head, self.rows, self.left = caption, head, rows, left
        self.marks = {}

    def marked(self, marks):
        """{row: class}"""
        self.marks = marks
        return self

    def text(self):
        """As markdown, which is also good to read as it is."""
        rows = [self.head, *self.rows]
        wide = [max(3, *(len(row[c]) for row in rows)) for c in range(len(self.head))]
        pad = lambda row: "| " + " | ".join(
            cell.ljust(w) if c < self.left else cell.rjust(w)
            for c, (cell, w) in enumerate(zip(row, wide))) + " |"
        rule = ["-" * w if c < self.left else "-" * (w - 1) + ":" for c, w in enumerate(wide)]
        lines = [self.caption, ""] if self.caption else []
        return "\n".join(lines + [pad(self.head), pad(rule), *map(pad, self.rows)])

    def compact(self):
        """As markdown that is not padded."""
        rule = ["---" if c < self.left else "---:" for c in range(len(self.head))]
        return "\n".join("| " + " | ".join(row) + " |" for row in [self.head, rule, *self.rows])

    def html(self):
        def row(cells, tag, mark=""):
            cells = "".join(f"<{tag}{' class=left' if c < self.left else ''}>{marked(cell)}</{tag}>"
                            for c, cell in enumerate(cells))
            return f"<tr{f' class={mark}' if mark else ''}>{cells}</tr>"

        body = "\n".join(row(r, "td", self.marks.get(i, "")) for i, r in enumerate(self.rows))
        caption = f"<caption>{marked(self.caption)}</caption>" if self.caption else ""
        return (f"<div class=wide><table>{caption}\n<thead>{row(self.head, 'th')}</thead>\n"
                f"<tbody>\n{body}\n</tbody></table></div>")


class Title:
    def __init__(self, words, level=2):
        self.words, self.level = words, level

    def text(self):
        return f"{'#' * self.level} {self.words}"

    def html(self):
        name = re.sub(r"[^a-z]+", "-", self.words.lower()).strip("-")
        return f"<h{self.level} id='{name}'>{marked(self.words)}</h{self.level}>"


class Words:
    """A paragraph; `code` between backquotes, *words* between stars."""

    def __init__(self, words):
        self.words = " ".join(words.split())

    def text(self):
        return self.words

    def html(self):
        return "<p>" + re.sub(r"\*([^*]+)\*", r"<em>\1</em>", marked(self.words)) + "</p>"


class Listing:
    """Text as a program printed it."""

    def __init__(self, words):
        self.words = words.rstrip("\n")

    def text(self):
        return self.words

    def html(self):
        return f"<pre>{html.escape(self.words)}</pre>"


class Plot:
    """A picture beside the page."""

    def __init__(self, file, about):
        self.file, self.about = file, about

    def text(self):
        return f"{self.file}: {self.about}"

    def html(self):
        return f"<p><img src='{self.file}' alt='{html.escape(self.about, True)}'></p>"


def marked(words):
    return re.sub(r"`([^`]*)`", r"<code>\1</code>", html.escape(words, False))


def bars_table(bars):
    table = Table("", ["what", "bar", "figure", ""], [b.cells() for b in bars], left=3)
    return table.marked({i: MET[b.met][1] for i, b in enumerate(bars)})


def write(directory, title, blocks):
    """index.html and report.txt."""
    os.makedirs(directory, exist_ok=True)
    body = "\n".join(b.html() for b in blocks)
    with open(os.path.join(directory, "index.html"), "w", encoding="utf-8") as f:
        f.write(f"<!DOCTYPE html>\n<html lang=en>\n<head><meta charset=utf-8>"
                f"<title>{html.escape(title)}</title>\n<style>{STYLE}</style></head>\n<body>\n"
                f"<h1>{html.escape(title)}</h1>\n{body}\n</body>\n</html>\n")
    with open(os.path.join(directory, "report.txt"), "w", encoding="utf-8") as f:
        f.write(f"# {title}\n\n" + "\n\n".join(b.text() for b in blocks) + "\n")


def replace_tables(path, tables):
    """Puts tables {name: Table} in a markdown file, each between the lines <!-- name --> and
    <!-- end -->, where it has such."""
    with open(path, encoding="utf-8") as f:
        text = f.read()
    for name, table in tables.items():
        body = table.compact() + "\n"
        place = re.compile(rf"(<!-- {name} -->\n).*?(?=<!-- end -->)", re.DOTALL)
        text = place.sub(lambda found: found[1] + body, text)
    with open(path, "w", encoding="utf-8") as f:
        f.write(text)
