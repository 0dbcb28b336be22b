import { expect, test } from "vitest";
import { replaced } from "../../../static/js/calendar/lesson_page.js";

function made(html) {
  const part = document.createElement("div");
  part.innerHTML = html;
  return part;
}

test("the newest line replaces the shown one, and the focus stays on its button", () => {
  const shown = made("<p>Ada drives</p><button>Skip Ada</button><button>Skip Ben</button>");
  document.body.append(shown);
  shown.lastChild.focus();
  const newest = made("<p>Ben is called</p><button>Skip Ben</button>");
  expect(replaced(shown, newest)).toBe(true);
  expect(shown.textContent).toBe("Ben is calledSkip Ben");
  expect(document.activeElement.textContent).toBe("Skip Ben");
});

test("nothing moves while nothing changed", () => {
  const shown = made("<button>Skip Ada</button>");
  const [button] = shown.children;
  expect(replaced(shown, made("<button>Skip Ada</button>"))).toBe(false);
  expect(replaced(shown, null)).toBe(false);
  expect(shown.firstChild).toBe(button);
});
