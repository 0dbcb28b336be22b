/** The calendar of bookings: all robots side by side; drag to book, move and lengthen. */

import { pageLanguage } from "../formats/languages.js";
import { make, mark, parts, setText, show } from "../lib/dom.js";
import { correctRoles } from "./accessible.js";
import { BookingDialog } from "./booking_dialog.js";
import { bookingsChannel, readFeed, send } from "./bookings_api.js";
import { atMost, listen } from "./live.js";

const POLL_MS = 30_000; // for a page without a connection, and for changes that come with time alone
const READS_MS = 500; // between two reads when many book at once
const PHONE_PX = 700;

/** Starts the calendar in the page. @param {HTMLElement} main @param {object} library EventCalendar */
export function startCalendar(main, library) {
  const part = parts(main);
  const { feed, new: newUrl, waiting, one: oneUrl, robot, day } = main.dataset;
  const dialog = new BookingDialog(part, { new: newUrl, waiting }, () => calendar.refetchEvents());
  let range = null;
  let newest = "";
  let robots = "[]"; // the columns
  let dragged = false; // the click at the end of a drag must not follow a link
  const names = new Map(); // of robots, by slug
  const hint = part.hint.textContent;
  const phone = globalThis.innerWidth < PHONE_PX;
  const first = phone ? part["phone-day"].dataset.view : "resourceTimeGridDay";

  const calendar = library.create(part.calendar, {
    view: first,
    locale: pageLanguage(),
    date: day,
    headerToolbar: { start: "", center: "", end: "" },
    views: {
      timeGridDay: { titleFormat: { year: "numeric", month: "short", day: "numeric" } },
      timeGridWeek: phone ? { dayHeaderFormat: { weekday: "short", day: "numeric" } } : {},
      resourceTimelineWeek: {
        slotDuration: "01:00",
        slotLabelInterval: "03:00", // in 24 px a label of each hour does not fit
        slotWidth: 24,
        slotLabelFormat: { hour: "2-digit", minute: "2-digit", hourCycle: "h23" },
      },
    },
    firstDay: 1,
    slotDuration: "00:30",
    scrollTime: scrollTime(new Date()),
    eventContent: ({ event, timeText, view }) => ({
      domNodes: eventLines(event, timeText, view.type, names, oneUrl),
    }),
    nowIndicator: sameClock(new Date()), // the library uses the browser's clock, not the page's
    selectable: true,
    unselectAuto: true,
    allDaySlot: false,
    noEventsContent: gettext("No bookings"),
    longPressDelay: 400,
    resources: [],
    eventSources: [
      {
        events: async ({ startStr, endStr }) => {
          range = [startStr, endStr];
          const answer = await read(startStr, endStr);
          newest = JSON.stringify(answer);
          for (const { id, title } of answer.resources) names.set(id, title);
          if (JSON.stringify(answer.resources) !== robots) {
            robots = JSON.stringify(answer.resources);
            calendar.setOption("resources", answer.resources);
            mark(part.calendar, "robots", answer.resources.length);
          }
          return answer.events;
        },
      },
    ],
    loading: (busy) => part.calendar.setAttribute("aria-busy", String(busy)),
    // Until the robots are read, the library shows one column without a robot.
    select: ({ startStr, endStr, resource }) =>
      dialog.ask(startStr, endStr, names.has(resource?.id) ? resource : null),
    datesSet: ({ view }) => setText(part.title, view.title),
    eventDragStart: () => {
      dragged = true;
    },
    eventResizeStart: () => {
      dragged = true;
    },
    eventDrop: (change) => drop(change),
    eventResize: (change) => drop(change),
  });

  /**
   * Reads the feed; if that fails, the page shows the reason: an empty calendar would look like free robots.
   */
  async function read(start, end) {
    try {
      const answer = await readFeed(feed, start, end, robot);
      setText(part.hint, hint);
      return answer;
    } catch (error) {
      setText(part.hint, error.message);
      throw error;
    }
  }

  async function drop({ event, revert, newResource }) {
    if (newResource) {
      revert();
      dialog.tell([
        gettext("A booking stays on its robot. Book the other robot, then cancel this one."),
      ]);
      return;
    }
    if (!(await move(event, wallClock(event.start), wallClock(event.end)))) revert();
  }

  /** Moves a booking, or shows the refusals and free slots instead. */
  async function move(event, startsAt, endsAt) {
    const answer = await send(`${oneUrl}${event.id}/`, {
      action: "move",
      version: event.extendedProps.version,
      starts_at: startsAt,
      ends_at: endsAt,
    });
    if (answer.ok) dialog.close();
    else
      dialog.tell(answer.texts, answer.alternatives, ({ start, end }) => move(event, start, end));
    calendar.refetchEvents();
    return answer.ok;
  }

  async function poll() {
    if (document.hidden || range === null) return;
    const answer = await read(...range).catch(() => null);
    if (answer && JSON.stringify({ ...answer, now: "" }) !== withoutNow(newest))
      calendar.refetchEvents();
  }
  const timer = setInterval(poll, POLL_MS);
  const changes = listen(main.dataset.socket, atMost(poll, READS_MS));
  document.addEventListener("visibilitychange", poll);
  bookingsChannel(() => calendar.refetchEvents());

  part.calendar.addEventListener("click", (click) => {
    if (dragged) click.preventDefault();
    dragged = false;
  });
  part.toolbar.addEventListener("click", ({ target }) => {
    const { go, view } = target.closest("button")?.dataset ?? {};
    if (go === "today") calendar.setOption("date", day);
    else if (go) calendar[go]();
    else if (view) turnTo(view);
  });
  function turnTo(view) {
    calendar.setOption("view", view);
    mark(part.calendar, "shown", view);
    for (const button of part.toolbar.querySelectorAll("[data-view]"))
      button.setAttribute("aria-pressed", String(button.dataset.view === view));
  }

  show(part.calendar, true);
  show(part.toolbar, true);
  show(part.hint, true);
  correctRoles(part.calendar);
  turnTo(first);
  setText(part.title, calendar.getView().title);
  return () => {
    clearInterval(timer);
    document.removeEventListener("visibilitychange", poll);
    changes.close();
  };
}

function withoutNow(text) {
  return text ? JSON.stringify({ ...JSON.parse(text), now: "" }) : "";
}

/** Return day and hour in a time zone, or in the browser's. @param {Date} now @param {string} [timeZone] */
function clock(now, timeZone) {
  const parts = { timeZone, day: "numeric", hour: "2-digit", minute: "2-digit", hourCycle: "h23" };
  return new Intl.DateTimeFormat("en", parts).format(now);
}

/** Return whether browser and page show the same time. @param {Date} now */
export function sameClock(now, zone = document.documentElement.dataset.zone) {
  return clock(now, zone || undefined) === clock(now);
}

/**
 * Return the time at which the day view begins: two hours before now in the page's zone.
 * @param {Date} now
 */
export function scrollTime(now, zone = document.documentElement.dataset.zone) {
  const options = { timeZone: zone || undefined, hour: "2-digit", hourCycle: "h23" };
  const hour = Number(new Intl.DateTimeFormat("en", options).format(now));
  return `${String(Math.max(hour - 2, 0)).padStart(2, "0")}:00:00`;
}

/** Return the lines of a booking: time, person, and the robot where its column does not name it. */
function eventLines(event, timeText, view, names, oneUrl) {
  if (event.display === "background") return [make("small", { text: event.title })];
  const robot = view.startsWith("resource") ? [] : [names.get(event.resourceIds[0]) ?? ""];
  const lines = [event.extendedProps.times ?? timeText, ...robot, event.title].map((text) =>
    make("span", { text }),
  );
  const link = make("a", { className: "event-link", children: lines });
  link.href = `${oneUrl}${event.id}/`;
  link.draggable = false;
  return [link];
}

/** Return a wall-clock time as the console reads it: "2026-03-02T14:30". @param {Date} at */
export function wallClock(at) {
  const two = (number) => String(number).padStart(2, "0");
  const day = `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())}`;
  return `${day}T${two(at.getHours())}:${two(at.getMinutes())}`;
}

const page = document.querySelector('[data-page="bookings"]');
if (page && globalThis.EventCalendar) startCalendar(page, globalThis.EventCalendar);
