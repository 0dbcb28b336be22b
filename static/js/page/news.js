/**
 * News about a person's bookings above a page, live. The driving page shows them as notices. A small screen shows the
 * subject of the newest, and counts the others.
 */

import { make, setText, show } from "../lib/dom.js";
import { NewsFeed } from "./news_feed.js";

/** @param {HTMLElement} card */
export function showNews(card, items) {
  const now = items.map(({ number }) => String(number));
  const rows = [...card.querySelectorAll("[data-number]")].map((row) => row.dataset.number);
  if (now.join() === rows.join()) return; // nothing is said twice
  card.querySelector("ul").replaceChildren(...items.map(rowOf));
  card.querySelector("[name=next]").value = location.pathname + location.search;
  card.querySelector("[name=newest]").value = now[0] ?? "";
  card.hidden = items.length === 0;
  countOthers(card);
}

/** Say how many there are beside the newest, of which a small screen shows the subject only. */
function countOthers(card) {
  const others = card.querySelectorAll("[data-number]").length - 1;
  const more = card.querySelector("[data-more]");
  show(more, others > 0 || card.querySelector(".news-text:not(:empty)") !== null);
  setText(more, others > 0 ? interpolate(gettext("%s more"), [others]) : gettext("More"));
}

/** Follow the news of this page's person. @param {HTMLElement} card */
export function followNews(card) {
  const more = card.querySelector("[data-more]");
  more.addEventListener("click", () => {
    more.setAttribute("aria-expanded", String(more.getAttribute("aria-expanded") === "false"));
  });
  countOthers(card);
  return new NewsFeed(card.dataset.news, (items) => showNews(card, items));
}

function rowOf({ number, subject, text, path }) {
  const title = make("strong");
  if (path) {
    const link = make("a", { text: subject });
    link.href = path;
    title.append(link);
  } else setText(title, subject);
  const words = make("span", { className: "quiet news-text", text });
  return make("li", { children: [title, " ", words], data: { number } });
}

const card = document.querySelector("[data-news]");
if (card) followNews(card);
