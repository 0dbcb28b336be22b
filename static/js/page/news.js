/** News about a person's bookings above a page, live. The driving page shows them as notices. */

import { make, setText } from "../lib/dom.js";
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
if (card) new NewsFeed(card.dataset.news, (items) => showNews(card, items));
