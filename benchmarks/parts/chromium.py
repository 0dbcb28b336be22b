"""Pages in a real browser."""

from __future__ import annotations

from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any

from playwright.async_api import Page, async_playwright

from script.stack.stack import Stack

CHROMIUM = "/usr/bin/chromium"

_TOPICS_SHOWN = """
(topics) => new Promise((done) => {
  const tab = [...document.querySelectorAll("[role=tab]")].find((tab) => tab.textContent.includes("Topics"));
  const began = performance.now();
  const look = () => {
    const rows = document.querySelectorAll("[data-part=topic-list] li:not([hidden])").length;
    if (rows >= topics) requestAnimationFrame(() => setTimeout(() => done(performance.now() - began)));
    else requestAnimationFrame(look);
  };
  tab.click();
  look();
})
"""


@asynccontextmanager
async def signed_in(stack: Stack, cookie: str, mapped: Sequence[str] = ()) -> AsyncIterator[Page]:
    """Context: an empty page of a signed-in person. `mapped`: Chromium's rules for other addresses of hosts."""
    async with AsyncExitStack() as closing:
        playwright = await closing.enter_async_context(async_playwright())
        browser = await playwright.chromium.launch(
            executable_path=CHROMIUM,
            args=[
                "--no-sandbox",
                "--disable-gpu",
                "--enable-unsafe-swiftshader",
                *(f"--host-resolver-rules={rule}" for rule in mapped),
            ],
        )
        closing.push_async_callback(browser.close)
        context = await browser.new_context()
        cookies: list[Any] = [
            {"name": name, "value": value, "url": stack.url}
            for name, value in (pair.split("=", 1) for pair in cookie.split("; "))
        ]
        await context.add_cookies(cookies)
        yield await context.new_page()


async def clock_offset_s(page: Page) -> float:
    """Return the zero of performance.now(): the navigation's start, from DevTools, in CLOCK_MONOTONIC."""
    tools = await page.context.new_cdp_session(page)
    await tools.send("Performance.enable")
    answer = await tools.send("Performance.getMetrics")
    metrics = {metric["name"]: metric["value"] for metric in answer["metrics"]}
    await tools.detach()
    return float(metrics["NavigationStart"])


async def topics_shown_s(stack: Stack, slug: str, cookie: str, topics: int) -> float:
    """Return the seconds from pressing the Topics tab until at least `topics` topics are painted."""
    async with signed_in(stack, cookie) as page:
        await page.goto(f"{stack.url}/robots/{slug}/")
        tab = page.get_by_role("tab", name="Topics")
        await tab.wait_for()
        return float(await page.evaluate(_TOPICS_SHOWN, topics)) / 1000.0
