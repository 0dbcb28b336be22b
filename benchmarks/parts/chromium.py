"""A WebSocket in a real browser that drives and records its times of sending."""

from __future__ import annotations

from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from types import TracebackType
from typing import Any

from playwright.async_api import Page, async_playwright

from script.stack.stack import Stack

CHROMIUM = "/usr/bin/chromium"

# Sends and receives like the control page, without drawing: the benchmark measures the network, not the page.
_OPEN = """
(address) => new Promise((done, failed) => {
  const socket = new WebSocket(address);
  const page = { socket, seq: 0, fence: null, robot: null };
  window.bench = page;
  socket.onopen = () => socket.send(JSON.stringify({
    t: "hello", tab: Array.from(crypto.getRandomValues(new Uint8Array(16)), (b) => (b % 36).toString(36)).join(""),
  }));
  socket.onclose = () => failed(new Error("closed"));
  socket.onmessage = (event) => {
    const message = JSON.parse(event.data);
    if (message.t === "view") socket.send('{"t":"ack"}');
    if (message.t === "welcome") {
      page.robot = message.robot;
      socket.send('{"t":"take"}');
    }
    if (message.t === "control" && message.state === "yours") {
      page.fence = message.fence;
      done(page.robot.limits.turn_radps);
    }
  };
})
"""

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

_DRIVE = """
([turns, period_ms, share]) => new Promise((done) => {
  const page = window.bench;
  const sent = [];
  const began = performance.now();
  const send = () => {
    const w = turns[sent.length];
    const sent_ms = performance.now();
    page.seq += 1;
    page.socket.send(JSON.stringify({ t: "drive", fence: page.fence, seq: page.seq, sent_ms, x: 0, w, share }));
    sent.push(sent_ms);
    if (sent.length === turns.length) return done(sent);
    setTimeout(send, Math.max(0, began + sent.length * period_ms - performance.now()));
  };
  send();
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


class ChromiumPage:
    """Async context: a signed-in page with control of `slug`."""

    def __init__(self, stack: Stack, slug: str, cookie: str) -> None:
        self._stack = stack
        self._slug = slug
        self._cookie = cookie
        self._closing = AsyncExitStack()
        self.full_turn_radps = 0.0

    async def __aenter__(self) -> ChromiumPage:
        self._page: Page = await self._closing.enter_async_context(signed_in(self._stack, self._cookie))
        # A page of the console's origin without scripts.
        await self._page.goto(f"{self._stack.url}/healthz")
        self._offset_s = await clock_offset_s(self._page)
        address = f"{self._stack.url.replace('http', 'ws', 1)}/ws/robots/{self._slug}/"
        self.full_turn_radps = await self._page.evaluate(_OPEN, address)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._closing.aclose()

    async def drive(self, turns: list[float], period_s: float, share: float) -> list[float]:
        """Send these turns at this period. Return when each turn was sent, in seconds of CLOCK_MONOTONIC."""
        sent_ms: list[float] = await self._page.evaluate(_DRIVE, [turns, 1000.0 * period_s, share])
        return [self._offset_s + ms / 1000.0 for ms in sent_ms]
