"""script/icons: draws the PNG icons of the installed app from the console's SVG, by Debian's Chromium."""

from __future__ import annotations

from playwright.sync_api import sync_playwright

from script.stack.places import REPOSITORY

IMAGES = REPOSITORY / "static/img"
COLOUR = "#0d6b66"  # of the square in the SVG
# File, pixels, and the drawing's share of the square. It is smaller in a maskable icon, which systems cut into any
# shape.
ICONS = (("icon-180.png", 180, 1.0), ("icon-192.png", 192, 1.0), ("icon-512.png", 512, 1.0))
MASKABLE = ("icon-maskable-512.png", 512, 0.8)


def main() -> None:
    """Draw all icons into static/img."""
    drawing = (IMAGES / "icon.svg").read_text(encoding="utf-8")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page()
        for name, pixels, share in (*ICONS, MASKABLE):
            page.set_viewport_size({"width": pixels, "height": pixels})
            ground = COLOUR if share < 1.0 else "transparent"
            page.set_content(
                f"<style>html{{background:{ground}}} body{{margin:0;height:100vh;display:grid;place-items:center}}"
                f"svg{{width:{share:.0%};height:{share:.0%}}}</style>{drawing}"
            )
            page.screenshot(path=IMAGES / name, omit_background=True)
        browser.close()


if __name__ == "__main__":
    main()
