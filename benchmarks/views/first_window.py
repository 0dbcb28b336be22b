"""The first window of fleet and control: bytes over the network, and time until a slow phone can use it.

The browser's cache is empty; its processor is four times slower than this computer's. The fleet can be used when its
cards are live, the driving page when it offers control.
"""

from __future__ import annotations

import asyncio
from typing import Any

from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts.chromium import signed_in
from script.stack.client import sign_in
from script.stack.stack import PRACTICE_ROBOTS, Stack, temporary_stack

SLOWER = 4
OPENINGS = 5
PHONE = {"width": 360, "height": 640}
OPENED_S = 60.0
USABLE_S = 1.5
KILOBYTES = {"fleet": 40.0, "control": 160.0}
PAGES = {
    "fleet": ("/", "() => document.querySelector('[data-part=connection]')?.dataset.level === 'ok'"),
    "control": ("/robots/tiago-1/", "() => document.querySelector('[data-action=take]')?.checkVisibility()"),
}
LANGUAGES = ("en", "es")  # other languages get their texts as well
# The page itself looks: Playwright's own waiting costs a slow phone a tenth of a second.
SAY = "console.info(`usable ${performance.now()}`)"
LOOK = f"{{ const look = () => (%s)() ? {SAY} : requestAnimationFrame(look); look() }}"


def measure() -> list[Figure]:
    """Run three robots, and open both pages in new browsers."""
    with temporary_stack(robots=PRACTICE_ROBOTS) as stack:
        return asyncio.run(measure_on(stack))


async def measure_on(stack: Stack) -> list[Figure]:
    """Return all figures."""
    cookie = await asyncio.to_thread(sign_in, stack, "operator")
    figures: list[Figure] = []
    for name in PAGES:
        for language in LANGUAGES:
            openings = [await opened(stack, cookie, name, language) for _ in range(OPENINGS)]
            kilobytes, seconds = (quantile(values, 0.5) for values in zip(*openings, strict=True))
            progress(f"{name}, {language}: {kilobytes:.1f} kB, {seconds:.2f} s")
            limited = language == "en"
            figures += [
                Figure(
                    f"{name} in {language}: first window",
                    kilobytes,
                    "kB",
                    KILOBYTES[name] if limited else None,
                ),
                Figure(f"{name} in {language}: usable after", seconds, "s", USABLE_S if limited else None),
            ]
    return figures


async def opened(stack: Stack, cookie: str, name: str, language: str) -> tuple[float, float]:
    """Return the kilobytes of pages, scripts and style sheets, and the seconds until the page can be used."""
    path, usable = PAGES[name]
    async with signed_in(stack, cookie) as page:
        await page.set_viewport_size(PHONE)  # type: ignore[arg-type]
        await page.set_extra_http_headers({"Accept-Language": language})
        await page.goto(f"{stack.url}/healthz")  # the browser's own start does not count
        tools = await page.context.new_cdp_session(page)
        sizes: dict[str, float] = {}

        def finished(event: dict[str, Any]) -> None:
            sizes[event["requestId"]] = event["encodedDataLength"]

        tools.on("Network.loadingFinished", finished)
        await tools.send("Network.enable")
        await tools.send("Emulation.setCPUThrottlingRate", {"rate": SLOWER})
        await page.add_init_script(LOOK % usable)
        said = page.expect_console_message(
            lambda line: line.text.startswith("usable"), timeout=OPENED_S * 1000.0
        )
        async with said as line:
            await page.goto(f"{stack.url}{path}", wait_until="commit")
        seconds = float((await line.value).text.split()[1]) / 1000.0
        await page.wait_for_load_state("networkidle")
        return sum(sizes.values()) / 1000.0, seconds
