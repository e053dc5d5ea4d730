"""Opens pages in a real browser at phone and desktop width, in light and dark, and on paper.

    python3 tests/browser/check_pages.py PAGE.html... [--screenshots FOLDER]

Fails on a console message, a request to anywhere, a page wider than its window, an element that
sticks out of it, a figure without size or whose lettering is too small, or one scheme that looks
like the other.

promise: readable-pages
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from chromium import Chromium

WIDTHS = (360, 390, 1280)
SCHEMES = ("light", "dark")
SMALLEST_LETTERING = 8.0

# Elements beyond the window's edge, but for those inside something that scrolls or clips by itself.
STICKING_OUT = """
[...document.querySelectorAll('body *')]
    .filter(e => !e.closest('svg') || e.tagName === 'svg')
    .filter(e => !e.closest('.table table'))
    .filter(e => e.getBoundingClientRect().right > innerWidth + 0.5)
    .map(e => e.tagName + '.' + (e.getAttribute('class') || ''))
"""
# Letters of a figure that its frame cuts off.
CUT_OFF = """
[...document.querySelectorAll('svg text')].filter(text => {
    const inner = text.getBoundingClientRect();
    const outer = text.closest('svg').getBoundingClientRect();
    return inner.left < outer.left - 1 || inner.right > outer.right + 1
        || inner.top < outer.top - 1 || inner.bottom > outer.bottom + 1;
}).map(text => text.textContent)
"""
# Legend entries and tick labels that lie on one another.
OVERLAPPING = """
[...document.querySelectorAll('svg')].flatMap(svg => {
    const texts = [...svg.querySelectorAll('text:not(.remark)')];
    const boxes = texts.map(text => text.getBoundingClientRect());
    const found = [];
    for (let i = 0; i < boxes.length; i++) for (let j = i + 1; j < boxes.length; j++) {
        const [a, b] = [boxes[i], boxes[j]];
        const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
        const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
        if (wide > 1 && high > 3) found.push(texts[i].textContent + ' / ' + texts[j].textContent);
    }
    return found;
})
"""
LETTERING = """
Math.min(...[...document.querySelectorAll('svg text')].map(text =>
    parseFloat(getComputedStyle(text).fontSize) * text.getScreenCTM().a))
"""
EMPTY_FIGURES = """
[...document.querySelectorAll('svg')].filter(svg => {
    const box = svg.getBoundingClientRect();
    return box.width < 200 || box.height < 100;
}).length
"""
COLOURS = """
[document.body, document.querySelector('svg .paper'), document.querySelector('svg .title')]
    .filter(Boolean)
    .map(e => { const s = getComputedStyle(e); return s.backgroundColor + s.fill + s.color; }).join()
"""


def check(browser: Chromium, page: Path, width: int, scheme: str) -> list[str]:
    """What is wrong with a page at a width in a colour scheme."""
    browser.open(page, width, scheme)
    problems = browser.complaints()
    content = browser.evaluate("document.documentElement.scrollWidth")
    if content > width:
        problems.append(f"is {content} px wide in a window of {width} px")
    problems += [f"{what} sticks out" for what in browser.evaluate(STICKING_OUT)]
    problems += [f"the text “{text}” is cut off" for text in browser.evaluate(CUT_OFF)]
    problems += [f"texts overlap: {pair}" for pair in browser.evaluate(OVERLAPPING)]
    if browser.evaluate("document.querySelectorAll('svg').length"):
        if empty := browser.evaluate(EMPTY_FIGURES):
            problems.append(f"{empty} figures have no size")
        smallest = browser.evaluate(LETTERING)
        if smallest < SMALLEST_LETTERING:
            problems.append(f"lettering of {smallest:.1f} px is too small")
    if browser.evaluate("document.querySelectorAll('h1').length") != 1:
        problems.append("has no single heading")
    return problems


def check_page(browser: Chromium, page: Path, screenshots: Path | None) -> int:
    """Checks a page in every way, prints what is wrong and counts it."""
    found = 0
    colours = {}
    for width in WIDTHS:
        for scheme in SCHEMES:
            problems = check(browser, page, width, scheme)
            colours[scheme] = browser.evaluate(COLOURS)
            if screenshots:
                screenshots.mkdir(parents=True, exist_ok=True)
                name = f"{page.parent.parent.name}-{page.parent.name}-{page.stem}-{width}-{scheme}.png"
                browser.screenshot(screenshots / name)
            for problem in problems:
                print(f"{page}, {width} px, {scheme}: {problem}", file=sys.stderr)
            found += len(problems)
    if colours["light"] == colours["dark"]:
        print(f"{page}: dark looks like light", file=sys.stderr)
        found += 1
    browser.open(page, 800, "dark", media="print")
    if not printable(browser):
        print(f"{page}: prints on a dark ground", file=sys.stderr)
        found += 1
    return found


def printable(browser: Chromium) -> bool:
    """Whether page and figures are on white."""
    white = "rgb(255, 255, 255)"
    ground = browser.evaluate("getComputedStyle(document.body).backgroundColor")
    paper = browser.evaluate("[...document.querySelectorAll('svg .paper')].map(e => getComputedStyle(e).fill)")
    return ground == white and all(colour == white for colour in paper)


def main() -> int:
    """Checks every page given."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pages", nargs="+", type=Path)
    parser.add_argument("--screenshots", type=Path, help="folder for PNG files of what was seen")
    arguments = parser.parse_args()
    with Chromium() as browser:
        found = sum(check_page(browser, page, arguments.screenshots) for page in arguments.pages)
    print(f"{len(arguments.pages)} pages, {found} problems")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
