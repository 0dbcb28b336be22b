"""The screen stays on while a person drives. The test uses Chromium's own wake lock."""

from __future__ import annotations

from collections.abc import Callable

from tests.browser.people import Person

Arrive = Callable[..., Person]

KEEP_THE_LOCKS = """
window.locks = [];
const request = navigator.wakeLock.request.bind(navigator.wakeLock);
navigator.wakeLock.request = async (kind) => {
  const lock = await request(kind);
  window.locks.push(lock);
  return lock;
};
"""
# In headless Chromium every page is visible. These scripts make the events of a page that is hidden and shown again.
HIDE = """
Object.defineProperty(document, 'hidden', {value: true, configurable: true});
Promise.all(window.locks.map((lock) => lock.release()))
  .then(() => document.dispatchEvent(new Event('visibilitychange')))
"""
SHOW = "delete document.hidden; document.dispatchEvent(new Event('visibilitychange'))"


def test_the_screen_stays_on_while_one_has_control(person: Arrive) -> None:
    operator = person("operator", apart=True)
    page = operator.page
    page.add_init_script(KEEP_THE_LOCKS)

    def held() -> int:
        count: int = page.evaluate("window.locks.filter((lock) => !lock.released).length")
        return count

    operator.watch("tiago-2")
    assert page.evaluate("window.locks.length") == 0
    operator.take("tiago-2")
    operator.until(lambda: held() == 1, "the screen to be kept on")
    page.evaluate(HIDE)
    assert held() == 0
    page.evaluate(SHOW)
    operator.until(lambda: held() == 1, "the screen to be kept on again")
    operator.release()
    operator.until(lambda: held() == 0, "the screen to be left alone")
