/** The report of a robot: when it was driven, as bars. The page also has the same figures as text. */

import { pageLanguage } from "../formats/languages.js";
import { parts } from "../lib/dom.js";
import { drawBars } from "./bars.js";

const A_MONDAY = Date.UTC(2024, 0, 1);
const DAY_MS = 86_400_000;

const page = parts(document.querySelector("[data-page=robot-report]"));
const { days, hours, weekdays } = JSON.parse(document.getElementById("use").textContent);

function named(format) {
  const dates = new Intl.DateTimeFormat(pageLanguage(), { timeZone: "UTC", ...format });
  return (ms) => dates.format(ms);
}

const dayName = named({ day: "numeric", month: "short" });
const weekdayName = named({ weekday: "short" });

drawBars(
  page.days,
  days.map(([midnightS]) => dayName(midnightS * 1000)),
  days.map(([, driven]) => driven),
);
drawBars(
  page.hours,
  hours.map((_, hour) => String(hour)),
  hours,
);
drawBars(
  page.weekdays,
  weekdays.map((_, i) => weekdayName(A_MONDAY + i * DAY_MS)),
  weekdays,
);
