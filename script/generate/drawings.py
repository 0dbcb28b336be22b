"""script/drawings: draws the Mermaid blocks of docs/ as SVG, by Mermaid in Debian's Chromium."""

from __future__ import annotations

import base64
import hashlib
import os
import subprocess
import tarfile
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

from script.stack.places import REPOSITORY

# Mermaid is not in package.json: it and its dependencies are larger than all other packages, and only this program
# needs them.
MERMAID = "mermaid@12.3.0"
SHA512 = "4113TdXeLAsMruJ79OpFL5O8+LTFXhQqZ260rF3tgUmiNAtRm4Uume04I+65PRN6yZ69J4f8rVYWW8zRk65UYw=="

# Colours of static/css/base/tokens.css. An image can read the browser's colour scheme, but not the page's variables.
STYLE = """
svg { background: #ffffff; color: #17201c; font: 14px "DejaVu Sans", Verdana, sans-serif; }
text { fill: currentColor; text-anchor: middle; }
.cluster-label text { text-anchor: start; }
.node :is(rect, path, polygon, circle) { fill: #ddefec; stroke: #0d6b66; }
.cluster rect { fill: none; stroke: #858e88; }
.flowchart-link { fill: none; stroke: #55605a; stroke-width: 1.5px; }
.edge-pattern-dotted { stroke-dasharray: 3; }
.marker { fill: #55605a; }
.edgeLabel .background { fill: #ffffff; }
@media (prefers-color-scheme: dark) {
  svg { background: #181e1b; color: #e9edea; }
  .node :is(rect, path, polygon, circle) { fill: #16332f; stroke: #62ccc0; }
  .cluster rect { stroke: #6d7973; }
  .flowchart-link { stroke: #a6b1ab; }
  .marker { fill: #a6b1ab; }
  .edgeLabel .background { fill: #181e1b; }
}
"""
DRAW = """async ([source, style]) => {
  mermaid.initialize({
    startOnLoad: false,
    layout: "dagre",
    look: "classic",
    deterministicIds: true,
    htmlLabels: false,
    fontFamily: "DejaVu Sans",
    themeVariables: { fontSize: "14px" },
    flowchart: { wrappingWidth: 260, rankSpacing: 15, padding: 10 },
  });
  const { svg } = await mermaid.render("drawing", source);
  const root = new DOMParser().parseFromString(svg, "image/svg+xml").documentElement;
  root.querySelector("style").textContent = style;
  const [, , width, height] = root.getAttribute("viewBox").split(" ").map(Math.ceil);
  for (const [name, value] of Object.entries({ width, height, role: "img" })) root.setAttribute(name, value);
  root.removeAttribute("style");
  return new XMLSerializer().serializeToString(root);
}"""


def main() -> None:
    """Draw all Mermaid blocks, and delete drawings that no page shows any more."""
    os.environ.setdefault("FLEET_DEBUG", "1")
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "fleet.settings")
    from fleet.help import pages

    sources = dict(found for name in sorted(pages.known()) for found in pages.drawings(name).items())
    folder = pages.DOCS / "img"
    for drawn in folder.glob("*.svg"):
        if drawn.name not in sources:
            drawn.unlink()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page()
        page.add_script_tag(content=_mermaid())
        for name, source in sources.items():
            (folder / name).write_text(page.evaluate(DRAW, [source, STYLE]) + "\n", encoding="utf-8")
        browser.close()


def _mermaid() -> str:
    """Download Mermaid, check its hash, and return its script, which is one file."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(  # noqa: S603
            [REPOSITORY / ".venv/bin/npm", "pack", "--silent", MERMAID],
            cwd=folder,
            check=True,
            stdout=subprocess.DEVNULL,
        )
        [packed] = Path(folder).glob("*.tgz")
        if hashlib.sha512(packed.read_bytes()).digest() != base64.b64decode(SHA512):
            raise SystemExit(f"script/drawings: {MERMAID} is not the file that was checked.")
        with tarfile.open(packed) as files:
            files.extract("package/dist/mermaid.min.js", folder)
        return Path(folder, "package/dist/mermaid.min.js").read_text(encoding="utf-8")


if __name__ == "__main__":
    main()
